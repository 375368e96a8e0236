"""Bridge to ROS 2: publishes the mesh's topics in the wire format of rmw_zenoh."""
