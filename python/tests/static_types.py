"""Types of results, which mypy checks: values for the sync client, awaitables for the async one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from palpate import AsyncClient, Belief, Client, Job, NextTouches, ObjectInfo, Session

if TYPE_CHECKING:
    from typing_extensions import assert_type

    def of_values(client: Client) -> None:
        assert_type(client.object("mug"), ObjectInfo)
        assert_type(client.train("default", seed=1), Job)
        with client.touch_session("arm") as session:
            assert_type(session.touch([0.0], None), Belief)
            assert_type(session.next_touches(), NextTouches)
        client.object(7)  # type: ignore[arg-type]
        client.object()  # type: ignore[call-arg]

    async def of_awaitables(client: AsyncClient) -> None:
        assert_type(await client.object("mug"), ObjectInfo)
        async with client.touch_session("arm") as session:
            assert_type(await session.touch([0.0], None), Belief)
            assert_type(await session.close(truth="mug"), Session)
        client.object(7)  # type: ignore[arg-type,unused-coroutine]
