"""How well reversed control data lead back to where the fluid was."""
