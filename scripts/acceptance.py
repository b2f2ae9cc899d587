"""Acceptance table of issue 30, flown in process: python /tmp/accept.py FAMILY... [--n N]"""

import sys, os, json, itertools, multiprocessing as mp, random, math, time, argparse
import numpy as np
from pathlib import Path
from gcs.scenario.model import scenario_of
from gcs.fleet.in_process import fly_in_process

LAWS = {"surviving": {"controller": {"kind": "surviving"}}, "tube": {}}
HW = {"ideal": [], "realistic": ["realistic"], "turbulent": ["turbulent"]}


def scenario(law, hw, faults, **kw):
    kw = dict(kw)
    tree = {
        "extends": ["paper/scenario1", *HW[hw], *(["tube"] if law == "tube" else [])],
        "faults": faults,
    }
    if law != "tube":
        tree["controller"] = {"kind": law}
    c = kw.pop("controller", None)
    if c:
        tree["controller"] = {
            **tree.get("controller", {"kind": "tube"} if law == "tube" else {}),
            **c,
        }
    tree.update(kw)
    import yaml, tempfile
    from gcs.scenario.model import load_scenario

    with tempfile.NamedTemporaryFile("w", suffix=".yaml", dir="/tmp/accs", delete=False) as f:
        yaml.safe_dump(tree, f)
    try:
        return load_scenario(f.name)
    finally:
        os.unlink(f.name)


NAMES = ["aileron", "elevator", "rudder", "throttle"]


def judge(law, hw, faults, uav=3, after=1.0, **kw):
    s = scenario(law, hw, faults, **kw)
    r = fly_in_process(s)
    i = list(r.uav_ids).index(uav)
    t = r.time_s
    ph = r.signals["phase"][:, i]
    lost = ph == 2
    dec = []
    for c in range(4):
        d = np.diff(lost[:, c].astype(int), prepend=0)
        for k in np.nonzero(d)[0]:
            dec.append((round(float(t[k]), 3), NAMES[c], "lost" if d[k] > 0 else "back"))
    dec.sort()
    st = r.states[:, i]
    err = np.rad2deg(np.abs(r.error("reference")[:, i]))  # V too
    e = r.error("reference")[:, i]
    ev = np.abs(e)
    m = t > after
    ev = ev[m]
    roll = np.rad2deg(np.nanmax(ev[:, 1]))
    pitch = np.rad2deg(np.nanmax(ev[:, 2]))
    yaw = np.rad2deg(np.nanmax(ev[:, 3]))
    V = float(np.nanmax(ev[:, 0]))
    others = sum(
        int((np.diff((r.signals["phase"][:, j, c] == 2).astype(int), prepend=0) > 0).sum())
        for j in range(len(r.uav_ids))
        if j != i
        for c in range(4)
    )
    events = int((r.signals["events"][:, i] != 0).sum())
    absroll = float(np.rad2deg(np.abs(st[:, ROLL]).max()))
    return dict(
        law=law,
        hw=hw,
        dec=dec,
        loss=r.loss,
        V=round(V, 1),
        roll=round(float(roll), 1),
        pitch=round(float(pitch), 1),
        yaw=round(float(yaw), 1),
        absroll=round(absroll, 1),
        others=others,
        events=events,
    )


ROLL = 6


def init():
    pass


def job(a):
    name, args, kw = a
    try:
        out = judge(*args, **kw)
    except Exception as e:
        out = dict(error=repr(e)[:200])
    out["case"] = name
    return out


def fam_start():
    vals = {
        "aileron": [0.0, 8.0, -2.0],
        "elevator": [0.0, 4.0, -5.0],
        "rudder": [20.0, 10.0, 30.0],
        "throttle": [700.0, 900.0],
    }
    for a, vs in vals.items():
        for v in vs:
            for t0 in (0.0, 0.04, 0.1, 0.2, 0.3, 0.6):
                yield (
                    f"start {a} {v} {t0}",
                    [
                        {
                            "uav": 3,
                            "actuator": a,
                            ("stuck_n" if a == "throttle" else "stuck_deg"): v,
                            "start_s": t0,
                        }
                    ],
                    dict(duration_s=10.0),
                )


def fam_osc():
    for a in ("aileron", "elevator", "rudder"):
        for v in (4.0, 10.0):
            for f in (0.1, 0.8, 1.5, 2.5, 4.0, 10.0):
                yield (
                    f"osc {a} {v} {f}",
                    [{"uav": 3, "actuator": a, "bias_deg": v, "frequency_hz": f, "start_s": 10.0}],
                    {},
                )


def fam_osc2(n=60, seed=21):
    rng = random.Random(seed)
    for k in range(n):
        a = rng.choice(NAMES[:3])
        v = rng.uniform(3, 10)
        f = math.exp(rng.uniform(math.log(0.1), math.log(10)))
        yield (
            f"osc2 {k} {a} {v:.1f} {f:.2f}",
            [
                {
                    "uav": 3,
                    "actuator": a,
                    "bias_deg": v,
                    "frequency_hz": f,
                    "start_s": rng.uniform(2, 16),
                }
            ],
            {},
        )


def fam_thr(n=30, seed=31):
    rng = random.Random(seed)
    for k in range(n):
        v = rng.uniform(300, 1500)
        t0 = rng.uniform(0, 12)
        end = k % 2
        f = {"uav": 3, "actuator": "throttle", "stuck_n": v, "start_s": t0}
        if end:
            f["end_s"] = t0 + rng.uniform(0.5, 6)
        yield f"thr {k} {v:.0f} {t0:.1f}-{f.get('end_s', '')}", [f], {}
    for k in range(8):
        t0 = rng.uniform(1, 12)
        f = {
            "uav": 3,
            "actuator": "throttle",
            "effectiveness": rng.uniform(0.05, 0.15),
            "start_s": t0,
            "end_s": t0 + 3,
        }
        yield f"thr loss{k} {f['effectiveness']:.2f} {t0:.1f}-{f['end_s']:.1f}", [f], {}


def fam_stuckosc():
    for a in ("aileron", "elevator", "rudder"):
        for v in (5.0,):
            for f in (0.1, 0.8, 1.5, 2.5, 4.0, 10.0):
                yield (
                    f"stuckosc {a} {v} {f}",
                    [{"uav": 3, "actuator": a, "stuck_deg": v, "frequency_hz": f, "start_s": 10.0}],
                    {},
                )


def fam_weak():
    for v in (0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4):
        for t0 in (8.0, 19.0):
            yield (
                f"weak aileron {v} {t0}",
                [{"uav": 3, "actuator": "aileron", "effectiveness": v, "start_s": t0}],
                {},
            )


def fam_dead():
    yield "dead none", [], {}
    for d in (0.02, 0.04):
        yield f"dead servo {d}", [], {"servos": {"surfaces": {"dead_time_s": d}}}
    yield "dead gyro 0.02", [], {"sensors": {"gyro_deg_s": {"latency_s": 0.02}}}
    yield "dead throttle 0.1", [], {"servos": {"throttle": {"dead_time_s": 0.1}}}


def fam_random(n=100, seed=77):
    rng = random.Random(seed)
    for k in range(n):
        a = rng.choice(NAMES)
        kind = rng.choice(["stuck", "bias", "loss"])
        t0 = rng.uniform(2, 22)
        f = {"uav": 3, "actuator": a, "start_s": round(t0, 3)}
        if rng.random() < 0.5:
            f["end_s"] = round(t0 + rng.uniform(0.5, 6), 3)
        if kind == "stuck":
            f.update(
                {"stuck_n": rng.uniform(300, 1500)}
                if a == "throttle"
                else {"stuck_deg": rng.uniform(-15, 20)}
            )
        elif kind == "bias":
            f.update(
                {"bias_n": rng.uniform(-500, 500)}
                if a == "throttle"
                else {"bias_deg": rng.uniform(-10, 10)}
            )
        else:
            f["effectiveness"] = rng.uniform(0.05, 0.95)
        yield (
            f"random {k} {a} {kind} {[round(v, 2) for q, v in f.items() if q.startswith(('stuck', 'bias', 'eff'))]} {f['start_s']}-{f.get('end_s', '')}",
            [f],
            {},
        )


def fam_healthy(n=60, seed=5, by=0.2):
    from gcs.scenario.model import load_scenario

    coefs = [c for c in type(load_scenario("paper/scenario1").uncertainty).model_fields]
    rng = random.Random(seed)
    for k in range(n):
        u = {c: rng.uniform(1 - by, 1 + by) for c in coefs}
        yield f"healthy {k}", [], {"uncertainty": u}


def fam_healthy30():
    yield from fam_healthy(60, 6, 0.3)


def fam_inter(n=40, seed=11):
    rng = random.Random(seed)
    for k in range(n):
        a = rng.choice(NAMES[:3])
        f = 1 / (2 * rng.uniform(0.2, 3))
        e = rng.choice([0.0, 0.0, 0.3, 0.6])
        lo, hi = dict(aileron=(-2, 10), elevator=(-3, 4), rudder=(12, 28))[a]
        v = rng.uniform(lo, hi) if e == 0 else rng.uniform(-5, 5)
        yield (
            f"inter {k} {a} e{e} {v:.1f} f{f:.2f}",
            [
                {
                    "uav": 3,
                    "actuator": a,
                    "effectiveness": e,
                    "intermittent_deg": v,
                    "frequency_hz": f,
                    "start_s": 8.0,
                    "end_s": 20.0,
                }
            ],
            {},
        )


def fam_drift(n=30, seed=12):
    rng = random.Random(seed)
    for k in range(n):
        a = rng.choice(NAMES[:3])
        r = math.exp(rng.uniform(math.log(0.2), math.log(5))) * rng.choice([1, -1])
        m = rng.uniform(4, 9)
        yield (
            f"drift {k} {a} {r:.2f} to {r * min(m / abs(r), 14):.1f}",
            [
                {
                    "uav": 3,
                    "actuator": a,
                    "drift_deg_s": r,
                    "start_s": 8.0,
                    "end_s": 8.0 + min(m / abs(r), 14),
                }
            ],
            {},
        )


def fam_hard(n=24, seed=13):
    rng = random.Random(seed)
    for k in range(n):
        a = rng.choice(NAMES[:3])
        lo, hi = dict(aileron=(-2, 10), elevator=(-5, 5), rudder=(6, 34))[a]
        v = rng.uniform(lo, hi)
        yield (
            f"hard {k} {a} {v:.1f}",
            [{"uav": 3, "actuator": a, "hardover_deg": v, "start_s": rng.uniform(2, 20)}],
            {},
        )


FAMS = {k[4:]: v for k, v in list(globals().items()) if k.startswith("fam_")}


def summary(res):
    import collections

    g = collections.defaultdict(list)
    for r in res:
        if "error" not in r:
            g[r["case"].split()[0], r["law"], r["hw"]].append(r)
    for k, rs in g.items():
        n = len(rs)
        bad = sum(r["absroll"] > 90 or bool(r["loss"]) for r in rs)
        mid = sum(45 < r["absroll"] <= 90 for r in rs)
        hl = sum(r["yaw"] > 15 for r in rs)
        dec = sum(any(d[2] == "lost" for d in r["dec"]) for r in rs)
        back = sum(any(d[2] == "back" for d in r["dec"]) for r in rs)
        r5 = sum(max(r["roll"], r["pitch"], r["yaw"]) > 5 for r in rs)
        print(
            f"{str(k):40s} n{n} att>90 {bad} >45 {mid} yaw>15 {hl} >5deg {r5} declared {dec} back {back} othersblamed {sum(r['others'] > 0 for r in rs)} medev {sorted(r['events'] for r in rs)[n // 2]}"
        )


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("fams", nargs="+")
    ap.add_argument("--laws", default="surviving,tube")
    ap.add_argument("--hw", default="ideal,realistic,turbulent")
    ap.add_argument("-j", type=int, default=2)
    ap.add_argument("--out")
    ap.add_argument("-q", action="store_true")
    A = ap.parse_args()
    jobs = []
    for f in A.fams:
        for name, faults, kw in FAMS[f]():
            for law in A.laws.split(","):
                for hw in A.hw.split(","):
                    jobs.append((name, (law, hw, faults), kw))
    t0 = time.time()
    with mp.Pool(A.j) as p:
        res = p.map(job, jobs, chunksize=4)
    if A.out:
        json.dump(res, open(A.out, "w"))
    for r in res:
        if "error" in r:
            print(r["case"], r["error"])
            continue
        if not A.q:
            print(
                f"{r['case']:34s} {r['law']:9s} {r['hw']:9s} V{r['V']:5} r{r['roll']:6} p{r['pitch']:6} y{r['yaw']:6} ev{r['events']:6} oth{r['others']} {r['loss'] or ''} {r['dec'][:4]}"
            )
    summary(res)
    print(len(jobs), "flights", round(time.time() - t0, 1), "s")


if __name__ == "__main__":
    main()
