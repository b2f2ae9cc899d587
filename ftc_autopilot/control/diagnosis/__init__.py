"""Diagnosis of the own actuators, from what an autopilot sends and measures.

Each actuator has a scalar measurement of what it does (`measurement`), a regression of that on
the commands over a short window (`regression`), and a phase: healthy, suspect, lost
(`suspicions`, `decisions`). Small movements of the commands add the excitation that the flight
lacks (`excitation`). Nothing here knows of fault commands.
"""

from ftc_autopilot.common.phases import HEALTHY, LOST, SUSPECT
from ftc_autopilot.control.diagnosis.decisions import is_in_care, may_be_weak
from ftc_autopilot.control.diagnosis.diagnose import diagnose
from ftc_autopilot.control.diagnosis.excitation import dithered, dithered_thrust, probe, probed
from ftc_autopilot.control.diagnosis.parameters import DiagnosisParameters, ThrottleDiagnosis
from ftc_autopilot.control.diagnosis.state import DIAGNOSIS

__all__ = [
    "DIAGNOSIS",
    "HEALTHY",
    "LOST",
    "SUSPECT",
    "DiagnosisParameters",
    "ThrottleDiagnosis",
    "diagnose",
    "dithered",
    "dithered_thrust",
    "is_in_care",
    "may_be_weak",
    "probe",
    "probed",
]
