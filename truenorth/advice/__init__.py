"""Advice before a log is recorded: how long, in which positions, by which manoeuvre."""

from truenorth.advice.manoeuvres import ManoeuvreAdvice, advise_manoeuvre
from truenorth.advice.positions import Advice, advise

__all__ = ["Advice", "ManoeuvreAdvice", "advise", "advise_manoeuvre"]
