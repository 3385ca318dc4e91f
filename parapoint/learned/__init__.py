"""The paper's method: five small networks, their losses, and how they are trained."""
