"""Missions are pinned, and give up files."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    # Not `batch_alter_table`: on SQLite it may put a new table in the old one's place, and dropping that
    # deletes the missions' events with it.
    op.add_column("mission", sa.Column("pinned", sa.Boolean(), nullable=False, server_default=sa.false()))
    op.add_column("mission", sa.Column("files", sa.String(16), nullable=False, server_default="all"))
