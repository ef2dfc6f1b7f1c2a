"""Missions may begin with the maps of another."""

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    with op.batch_alter_table("mission") as mission:
        mission.add_column(sa.Column("extends", sa.String(64), nullable=True))
