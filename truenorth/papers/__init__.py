"""Published systems, reproduced: scenario, the paper's figures, ours beside them, and what of its claims holds."""

from truenorth.papers.study import STUDIES, Study, reproduce

__all__ = ["STUDIES", "Study", "reproduce"]
