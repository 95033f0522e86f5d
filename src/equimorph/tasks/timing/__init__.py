"""Schedules in time: how fast they may be, and motions that actuators can execute."""
