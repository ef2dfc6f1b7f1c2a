"""Missions are pinned, and give up files."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    with op.batch_alter_table("mission") as mission:
        mission.add_column(sa.Column("pinned", sa.Boolean(), nullable=False, server_default=sa.false()))
        mission.add_column(sa.Column("files", sa.String(16), nullable=False, server_default="all"))
