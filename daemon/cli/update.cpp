// `plumb update`: sends a bundle to a running plumbd and follows its installation.
#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <thread>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/progress.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Kind = ControlRequest::Kind;

constexpr std::chrono::milliseconds kPollInterval{300};

struct UpdateArguments {
  std::optional<fs::path> file;
  bool restart = false;
};

std::shared_ptr<const AttachedFile> OpenBundle(const fs::path& path) {
  auto file =
      std::make_shared<const AttachedFile>(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (file->fd() < 0 || ::fstat(file->fd(), &status) != 0)
    throw DataError(fmt::format("{} cannot be read: {}", path.string(), std::strerror(errno)));
  if (!S_ISREG(status.st_mode))
    throw DataError(
        fmt::format("{} is not a regular file: name a bundle, NAME.raucb", path.string()));
  return file;
}

/// A refusal because of the bundle has exit code 3, one because of the present state 5.
Json Ask(ControlRequest request, const CommandContext& context) {
  Json answer = AskPlumbd(context.control, request, context.stop, std::nullopt);
  if (answer.value("ok", false)) return answer;
  const std::string why = answer.value("error", "refused without a reason");
  if (answer.value("input", false)) throw DataError(why);
  throw DeviceError(why);
}

ControlRequest RequestOf(Kind kind) { return {.kind = kind, .action = {}, .argument = {}}; }

/// Returns when the installation has ended; throws if it failed.
void Follow(Progress& progress, const CommandContext& context) {
  for (;;) {
    const Json status = Ask(RequestOf(Kind::kUpdateStatus), context);
    if (!status.value("installing", false)) {
      progress.Clear();
      if (const std::string why = status.value("failure", ""); !why.empty())
        throw IoError("not installed: " + why);
      return;
    }
    const std::string step = status.value("message", "");
    progress.Update(step.empty() ? "installing" : step, status.value("fraction", 0.0));
    if (context.stop.stop_requested())
      throw Interrupted("plumbd goes on with the installation; its page shows how far it is");
    std::this_thread::sleep_for(kPollInterval);
  }
}

int Update(const UpdateArguments& options, const CommandContext& context) {
  if (!options.file && !options.restart)
    throw std::invalid_argument("name a bundle, or give --restart");
  if (options.file) {
    ControlRequest request = RequestOf(Kind::kUpdate);
    request.name = options.file->filename().string();
    request.file = OpenBundle(*options.file);
    Progress progress;
    progress.Update("sending and checking " + request.name, 0.0);
    (void)Ask(request, context);
    Follow(progress, context);
    PrintOut(request.name + " is installed and starts at the next restart of the machine\n");
  }
  if (options.restart) {
    (void)Ask(RequestOf(Kind::kRestart), context);
    PrintOut("the machine restarts\n");
  }
  return kDone;
}

}  // namespace

Command AddUpdate(CLI::App& app) {
  auto options = std::make_shared<UpdateArguments>();
  app.add_option("file", options->file, "A bundle, NAME.raucb, signed for this machine")
      ->type_name("FILE");
  app.add_flag("--restart", options->restart,
               "Restart the machine, after the installation where a bundle is named; refused while "
               "somebody is scanned");
  return [options](const CommandContext& context) { return Update(*options, context); };
}

}  // namespace plumb
