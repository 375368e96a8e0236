"""What drivers share: questions in turn, one motion at a time, the proof of rest, names of signals.

What each driver must have belongs to `seam`.
"""
