"""Videos of a policy that acts with a simulated partner; the video says that no person takes part."""
