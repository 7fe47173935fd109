"""What measures and compares: `gbm study`."""
