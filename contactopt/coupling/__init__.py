"""The way from bodies to the interface problem and back: couplings, reduction and recovery."""
