"""The paper's theory made checkable; see docs/explanation/theory.md."""

from gcs.lab.theory.check import Theory, UavTheory, check_theory
from gcs.lab.theory.findings import theory_sentences

__all__ = ["Theory", "UavTheory", "check_theory", "theory_sentences"]
