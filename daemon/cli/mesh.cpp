// SPDX-License-Identifier: Apache-2.0
#include <memory>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/files/scene_folder.hpp"
#include "daemon/mesh_formats/mesh_file.hpp"
#include "words/cli.hpp"

namespace plumb {
namespace {

struct MeshArguments {
  std::filesystem::path scene, out;
  std::string unit;
};

int Run(const MeshArguments& options, const CommandContext& context) {
  const Scene scene = ReadScene(options.scene, {.cloud = false, .height_map = false, .mesh = true});
  if (scene.mesh.triangles.empty()) {
    throw DataError(say::cli::NoMesh(options.scene.string()));
  }
  const MeshUnit unit = Named<MeshUnit>(options.unit).value_or(UsualUnit(options.out));
  WriteMeshFile(options.out, scene.mesh, unit);
  PrintOut(context.Said(say::cli::Mesh(
               options.out.string(), static_cast<std::int64_t>(scene.mesh.vertices.size()),
               static_cast<std::int64_t>(scene.mesh.triangles.size()), Name(unit))) +
           "\n");
  return kDone;
}

}  // namespace

Command AddMesh(CLI::App& app) {
  auto options = std::make_shared<MeshArguments>();
  app.add_option("scene", options->scene, "Scene folder")->required()->type_name("SCENE");
  app.add_option("--out", options->out, "File to write; its extension selects the format")
      ->required()
      ->type_name("FILE.ply|.stl|.obj");
  app.add_option("--unit", options->unit,
                 "Of the coordinates: by default mm in .stl, m in .ply and .obj")
      ->check(CLI::IsMember({"mm", "m"}))
      ->type_name("mm|m");
  return [options](const CommandContext& context) { return Run(*options, context); };
}

}  // namespace plumb
