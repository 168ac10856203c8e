"""How each published figure of hybridmpm is made: `python -m hybridmpm_lab NAME` measures a result again."""
