"""The rigid body and the forces of air and engine on it, with its parameters."""
