#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/files/mesh_file.hpp"
#include "daemon/files/scene_folder.hpp"

namespace plumb {
namespace {

struct MeshArguments {
  std::filesystem::path scene, out;
};

int Run(const MeshArguments& options) {
  const Scene scene = ReadScene(options.scene, {.cloud = false, .height_map = false, .mesh = true});
  if (scene.mesh.triangles.empty()) {
    throw DataError(
        fmt::format("scene '{}' has no mesh: it has no height map, because the reference marker "
                    "was not seen; its surface is cloud.ply",
                    options.scene.string()));
  }
  WriteMeshFile(options.out, scene.mesh);
  PrintOut(fmt::format("{}: {} vertices, {} triangles\n", options.out.string(),
                       scene.mesh.vertices.size(), scene.mesh.triangles.size()));
  return kDone;
}

}  // namespace

Command AddMesh(CLI::App& app) {
  auto options = std::make_shared<MeshArguments>();
  app.add_option("scene", options->scene, "Scene folder")->required()->type_name("SCENE");
  app.add_option("--out", options->out, "File to write; its extension selects the format")
      ->required()
      ->type_name("FILE.ply|.stl|.obj");
  return [options](const CommandContext&) { return Run(*options); };
}

}  // namespace plumb
