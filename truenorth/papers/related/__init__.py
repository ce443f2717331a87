"""What the five papers cite and build on: one page each."""
