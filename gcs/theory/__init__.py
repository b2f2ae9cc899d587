"""The paper's theory made checkable; see docs/theory.md."""

from gcs.theory.check import check_theory
from gcs.theory.words import theory_words

__all__ = ["check_theory", "theory_words"]
