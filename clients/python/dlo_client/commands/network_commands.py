"""The commands for networks: ``dlo models`` and what can be done with one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from dlo_client.client import Client
from dlo_client.commands.app import app
from dlo_client.commands.printing import print_networks, print_versions

models_app = typer.Typer(
    no_args_is_help=False, help="List the networks of the service, and manage one's own."
)
app.add_typer(models_app, name="models")

Name = Annotated[str, typer.Argument(help="As in the list.")]


@models_app.callback(invoke_without_command=True)
def models(context: typer.Context) -> None:
    """List the networks of the service, and manage one's own; warm ones are loaded before the first
    job."""
    if context.invoked_subcommand is None:
        print_networks(_client(context).networks())


@models_app.command()
def show(context: typer.Context, name: Name) -> None:
    """A network and its versions."""
    network = _client(context).network(name)
    print_networks([network])
    print_versions(network)


@models_app.command()
def use(
    context: typer.Context,
    name: Name,
    version: Annotated[int, typer.Argument(min=1, help="A newer or an older one.")],
) -> None:
    """Let the name stand for another version: from now on requests that name it take that one."""
    print_versions(_client(context).choose_version(name, version))


@models_app.command()
def export(
    context: typer.Context,
    name: Name,
    file: Annotated[Path, typer.Argument(dir_okay=False, help="To write, such as NAME.dlonet.")],
    version: Annotated[int | None, typer.Option(min=1, help="Default: the one in service.")] = None,
) -> None:
    """Write a network to one file, for another service."""
    file.write_bytes(_client(context).network_file(name, version))
    typer.echo(f"wrote {file}")


@models_app.command(name="import")
def take_in(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(dir_okay=False, help="What `export` wrote.")],
    name: Annotated[str | None, typer.Option(help="Default: the name in the file.")] = None,
) -> None:
    """Take in a network from its file, as the next version of its name; a worker checks it
    first."""
    network = _client(context).import_network(file, name)
    print_networks([network])
    print_versions(network)


@models_app.command()
def delete(
    context: typer.Context,
    name: Name,
    version: Annotated[int | None, typer.Option(min=1, help="Default: all versions.")] = None,
) -> None:
    """Delete a network, or one of its versions."""
    _client(context).delete_network(name, version)
    typer.echo(f"deleted {name}" if version is None else f"deleted version {version} of {name}")


def _client(context: typer.Context) -> Client:
    client: Client = context.obj
    return client
