"""What does the camera on the head see? MuJoCo renders the hall, a lens bends the picture.

MuJoCo's cameras are pinholes, so the fisheye is cut from a wide one: every pixel of the fisheye
looks up where its ray meets the flat picture. That reaches 60 degrees from the axis, where twin A's
own renderer reaches 81.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cpl.quadruped.kinematic.camera import FisheyeCamera
from cpl.quadruped.kinematic.room import SIZE, TEXELS_PER_M, Room
from cpl.quadruped.legged.robot import mujoco

__all__ = ["Eye"]


class Eye:
    """The hall in MuJoCo, and a camera that can be put anywhere in it. `close` it in the end.

    Args:
        room: Its measures.
        paint: Reflectance of its six faces, uint8 (6, 512, 512).
        camera: The lens; its field is at most 1.1 rad.

    Raises:
        ValueError: A field that a flat picture cannot hold.
    """

    def __init__(self, room: Room, paint: NDArray[np.uint8], camera: FisheyeCamera) -> None:
        if not camera.field_rad <= 1.1:
            raise ValueError(f"camera.field_rad must be at most 1.1, not {camera.field_rad}")
        self._mj = mujoco()
        half = int(np.ceil(camera.focal_px * np.tan(camera.field_rad))) + 1
        self._model = _hall(self._mj, room, paint, float(np.arctan(half / camera.focal_px)), half)
        self._data = self._mj.MjData(self._model)
        self._renderer = self._mj.Renderer(self._model, 2 * half, 2 * half)
        self._shape = camera.height, camera.width
        self.inside, rays = camera.pixel_rays
        # Where a ray meets the flat picture, in places of pixel centres.
        flat = camera.focal_px * rays[:, :2] / rays[:, 2:] + (half - 0.5)
        grid = np.full((2, camera.height * camera.width), -1.0, dtype=np.float32)
        grid[:, self.inside] = flat.T
        self._u, self._v = grid.reshape(2, *self._shape)

    def expose(self, poses: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the mean reflectance that each pixel of the fisheye sees over an exposure.

        Args:
            poses: Camera position and rotation (row-major, camera to world), (n, 12).

        Returns:
            0 to 255, 0 outside the field, (height, width).
        """
        total = sum(self._flat(pose).astype(np.float32) for pose in poses)
        flat = np.asarray(total, dtype=np.float32) / len(poses)
        seen = cv2.remap(flat, self._u, self._v, cv2.INTER_LINEAR, borderValue=0.0)
        return seen.astype(np.float32, copy=False)

    def close(self) -> None:
        """Give the renderer's memory back."""
        self._renderer.close()

    def _flat(self, pose: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return one flat picture, grey."""
        mj, data = self._mj, self._data
        # MuJoCo's cameras look along -z with y up; ours along z with y down.
        turn = pose[3:].reshape(3, 3) * np.array([1.0, -1.0, -1.0])
        data.mocap_pos[0] = pose[:3]
        mj.mju_mat2Quat(data.mocap_quat[0], np.ascontiguousarray(turn).ravel())
        mj.mj_kinematics(self._model, data)
        mj.mj_camlight(self._model, data)
        self._renderer.update_scene(data, "eye")
        return self._renderer.render()[:, :, 0]


def _hall(mj: Any, room: Room, paint: NDArray[np.uint8], field_rad: float, half: int) -> Any:  # noqa: ANN401
    """Return a box of six painted planes, lit evenly: how bright it is, is the sensor's affair."""
    spec, (x, y, height) = mj.MjSpec(), room.box
    visual = spec.visual
    visual.quality.offsamples = visual.quality.shadowsize = 0
    visual.headlight.ambient = [1, 1, 1]
    visual.headlight.diffuse = visual.headlight.specular = [0, 0, 0]
    visual.map.znear, visual.map.zfar = 0.01, 100.0
    visual.global_.offwidth = visual.global_.offheight = 2 * half
    middle = height / 2
    # Place, half widths along the plane's own axes, normal.
    faces = (
        ((-x, 0, middle), (middle, y), (1, 0, 0)),
        ((x, 0, middle), (middle, y), (-1, 0, 0)),
        ((0, -y, middle), (x, middle), (0, 1, 0)),
        ((0, y, middle), (x, middle), (0, -1, 0)),
        ((0, 0, 0), (x, y), (0, 0, 1)),
        ((0, 0, height), (x, y), (0, 0, -1)),
    )
    for number, (place, widths, normal) in enumerate(faces):
        texture = spec.add_texture(
            name=f"paint {number}",
            type=mj.mjtTexture.mjTEXTURE_2D,
            width=SIZE,
            height=SIZE,
            nchannel=3,
        )
        texture.data = np.repeat(paint[number][:, :, None], 3, axis=2).tobytes()
        material = spec.add_material(
            name=f"wall {number}",
            texuniform=True,
            texrepeat=[2 * TEXELS_PER_M / SIZE] * 2,  # MuJoCo counts on planes in half widths
            specular=0,
            reflectance=0,
        )
        material.textures[mj.mjtTextureRole.mjTEXROLE_RGB] = f"paint {number}"
        face = spec.worldbody.add_geom(
            type=mj.mjtGeom.mjGEOM_PLANE,
            pos=place,
            size=[*widths, 0.1],
            material=f"wall {number}",
        )
        face.alt.type, face.alt.zaxis = mj.mjtOrientation.mjORIENTATION_ZAXIS, normal
    head = spec.worldbody.add_body(name="head", mocap=True)
    head.add_camera(name="eye", fovy=float(np.degrees(2 * field_rad)))
    return spec.compile()
