"""Zhao, Li, Cheng (2018): a double filter that damps a marine INS, reproduced."""
