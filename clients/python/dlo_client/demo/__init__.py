"""What shows the loops without a robot or a camera: a simulated table, and pictures of what
happened."""
