"""Published systems, reproduced: scenario, the paper's figures, ours next to them, and what of its claims holds."""

from truenorth.papers.study import STUDIES, Study, reproduce, save_all

__all__ = ["STUDIES", "Study", "reproduce", "save_all"]
