"""Operations on the plan of one vehicle: profile or mission, fence, rally points."""

from collections.abc import Sequence
from pathlib import Path

from gcs.console.errors import CommandRefused
from gcs.station.given import areas_of, mission_of, profile_of
from gcs.station.mission import Mission
from gcs.station.vehicle_link import Progress, VehicleLink
from mavlink_defs import dialect
from mavlink_defs.profile import (
    ANY_AIRSPEED,
    ProfileError,
    Segment,
    items_to_segments,
    segments_to_items,
)
from mavlink_defs.services.mission import (
    MissionDownloader,
    MissionFinished,
    MissionItem,
    MissionUploader,
)

_FENCE, _RALLY = dialect.MAV_MISSION_TYPE_FENCE, dialect.MAV_MISSION_TYPE_RALLY


class PlanTransfers(VehicleLink):
    """What transfers the parts of a plan; all of them belong to `gcs.station.vehicle.Vehicle`."""

    async def upload_profile(
        self, profile: Sequence[Segment] | Path | str, progress: Progress | None = None
    ) -> None:
        """Upload a reference profile; if it is refused, the old one stays active.

        Args:
            profile: Segments, or a file of `gcs profile upload`.
            progress: Called with the number of items done and the total.

        Raises:
            BadInput: The file cannot be used.
        """
        segments = profile_of(profile) if isinstance(profile, Path | str) else profile
        await self._upload(segments_to_items(segments, *self._address), "a profile", progress)

    async def download_profile(self, progress: Progress | None = None) -> tuple[Segment, ...]:
        """Download its profile, empty if it has none; `state.profile` holds it from then on.

        Raises:
            CommandRefused: The vehicle refused, or holds a mission that is not a profile.
        """
        mission = await self._download("its profile", progress)
        try:
            return items_to_segments(mission, ANY_AIRSPEED) if len(mission) > 1 else ()
        except ProfileError as problem:
            text = f"UAV {self.system} holds a mission that is no profile: {problem}"
            raise CommandRefused(text, dialect.MAV_MISSION_INVALID) from problem

    async def upload_mission(
        self, mission: Mission | Path | str, progress: Progress | None = None
    ) -> None:
        """Upload a mission; if it is refused, the old one stays active.

        Args:
            mission: Items, home included, or a file of `gcs mission upload`.
            progress: Called with the number of items done and the total.

        Raises:
            BadInput: The file cannot be used.
        """
        items = mission_of(mission) if isinstance(mission, Path | str) else mission
        await self._upload(items, "a mission", progress)

    async def download_mission(self, progress: Progress | None = None) -> Mission:
        """Download its mission, home included; `state.mission` holds it from then on."""
        return await self._download("its mission", progress)

    async def upload_fence(
        self, fence: Mission | Path | str, progress: Progress | None = None
    ) -> None:
        """Upload a fence, without items to clear it; if it is refused, the old one stays active.

        It is watched while FENCE_ENABLE is 1, which `enable_fence` sets.

        Args:
            fence: Items numbered from 0, or a file of `gcs mission upload`.
            progress: Called with the number of items done and the total.

        Raises:
            BadInput: The file cannot be used.
        """
        items = areas_of(fence).fence if isinstance(fence, Path | str) else fence
        await self._upload(items, "a fence", progress, _FENCE)

    async def download_fence(self, progress: Progress | None = None) -> Mission:
        """Download its fence; `state.areas` holds it from then on."""
        return await self._download("its fence", progress, _FENCE)

    async def upload_rally(
        self, rally: Mission | Path | str, progress: Progress | None = None
    ) -> None:
        """Upload rally points, which RTL leads to; arguments as of `upload_fence`."""
        items = areas_of(rally).rally if isinstance(rally, Path | str) else rally
        await self._upload(items, "rally points", progress, _RALLY)

    async def download_rally(self, progress: Progress | None = None) -> Mission:
        """Download its rally points; `state.areas` holds them from then on."""
        return await self._download("its rally points", progress, _RALLY)

    async def _upload(
        self,
        items: Sequence[MissionItem],
        what: str,
        progress: Progress | None,
        mission_type: int = dialect.MAV_MISSION_TYPE_MISSION,
    ) -> None:
        machine = MissionUploader(self._own, self._address, items, mission_type)
        done, reasons = await self._transfer(machine, progress)
        ok = dialect.MAV_MISSION_ACCEPTED
        self._judge(f"the upload of {what}", done.result, ok, "MAV_MISSION_RESULT", reasons)

    async def _download(
        self,
        what: str,
        progress: Progress | None,
        mission_type: int = dialect.MAV_MISSION_TYPE_MISSION,
    ) -> Mission:
        machine = MissionDownloader(self._own, self._address, mission_type)
        done, reasons = await self._transfer(machine, progress)
        ok = dialect.MAV_MISSION_ACCEPTED
        known = done.items if done.result == ok else None
        if mission_type == dialect.MAV_MISSION_TYPE_MISSION:
            self._emit(self.state.learn_mission(known, self._now()))
        else:
            self._emit(self.state.learn_areas(mission_type, known, self._now()))
        self._judge(f"the download of {what}", done.result, ok, "MAV_MISSION_RESULT", reasons)
        return done.items

    async def _transfer(
        self, machine: MissionUploader | MissionDownloader, progress: Progress | None
    ) -> tuple[MissionFinished, list[str]]:
        return await self._run(
            "mission",
            machine,
            machine.start,
            MissionFinished,
            progress,
            stop=lambda _: machine.cancel(),
        )
