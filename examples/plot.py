"""Plot a recording's joints and tool over time.

./dev run python examples/plot.py RECORDING.mcap PICTURE.png
"""

import sys

import matplotlib.pyplot as plt

import robomesh

if len(sys.argv) != 3:
    sys.exit(__doc__)
try:
    recording = robomesh.open_recording(sys.argv[1])
    joints = recording.joints()
    tool = recording.values("kinematics/tool/x", "kinematics/tool/y", "kinematics/tool/z")
except robomesh.RobomeshError as error:
    sys.exit(f"not done: {error}")

figure, (above, below) = plt.subplots(2, sharex=True, layout="constrained", figsize=(9, 6))
above.plot(joints.time_s, joints.positions_deg, label=joints.names)
for name, value in tool.items():
    below.plot(value.time_s, value.values, label=name)
above.set(title=recording.info.name, ylabel="joints [deg, mm]")
below.set(xlabel="time since the start [s]", ylabel="tool [m]")
for plot in (above, below):
    plot.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
figure.savefig(sys.argv[2])
