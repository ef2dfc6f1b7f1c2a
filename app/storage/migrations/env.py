"""Alembic's entry point: it runs inside the transaction that `Database.open` began."""

from alembic import context
from sqlmodel import SQLModel

import app.storage.tables

assert app.storage.tables  # its import fills the metadata
context.configure(
    connection=context.config.attributes["connection"],
    target_metadata=SQLModel.metadata,
    render_as_batch=True,
)
with context.begin_transaction():
    context.run_migrations()
