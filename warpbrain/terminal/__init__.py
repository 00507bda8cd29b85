"""Talking with a person at a terminal: progress, interruption, a quiet start.

`command` runs a command and turns whatever went wrong into one line and an exit status; `interrupt` ends it within a
second of Ctrl-C. `record` prints and keeps what is said for the log, `result_folder` claims the folder of results and
leaves nothing half-written in it.
"""
