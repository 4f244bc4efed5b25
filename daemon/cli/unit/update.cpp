// SPDX-License-Identifier: Apache-2.0
// `plumb update`: sends a bundle to a running plumbd and follows its installation.
#include <fcntl.h>
#include <sys/stat.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <thread>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/ask_plumbd.hpp"
#include "daemon/cli/commands.hpp"
#include "daemon/cli/progress.hpp"
#include "words/cli.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;
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
    throw DataError(say::update::Unreadable(path.string(), std::strerror(errno)));
  if (!S_ISREG(status.st_mode)) throw DataError(say::update::NoBundleFile(path.string()));
  return file;
}

/// A refusal because of the bundle has exit code 3, one because of the present state 5.
Json Ask(ControlRequest request, const CommandContext& context) {
  Json answer = AskPlumbd(context.control, request, context.stop, std::nullopt);
  if (answer.value("ok", false)) return answer;
  if (answer.value("input", false)) throw DataError(WhyRefused(answer));
  throw DeviceError(WhyRefused(answer));
}

ControlRequest RequestOf(Kind kind) { return {.kind = kind, .action = {}, .argument = {}}; }

/// Returns when the installation has ended; throws if it failed.
void Follow(Progress& progress, const CommandContext& context) {
  for (;;) {
    const Json status = Ask(RequestOf(Kind::kUpdateStatus), context);
    if (!status.value("installing", false)) {
      progress.Clear();
      if (const Message why = SaidIn(status, "failure"); !why.empty())
        throw IoError(say::cli::NotInstalled(why));
      return;
    }
    const Message step = SaidIn(status, "message");
    progress.Update(step.empty() ? say::cli::Installing() : step, status.value("fraction", 0.0));
    if (context.stop.stop_requested()) throw Interrupted(say::cli::UpdateGoesOn());
    std::this_thread::sleep_for(kPollInterval);
  }
}

int Update(const UpdateArguments& options, const CommandContext& context) {
  if (!options.file && !options.restart) throw InvalidRequest(say::cli::NameABundle());
  if (options.file) {
    ControlRequest request = RequestOf(Kind::kUpdate);
    request.name = options.file->filename().string();
    request.file = OpenBundle(*options.file);
    Progress progress(context.language);
    progress.Update(say::cli::Sending(request.name), 0.0);
    (void)Ask(request, context);
    Follow(progress, context);
    PrintOut(context.Said(say::cli::Installed(request.name)) + "\n");
  }
  if (options.restart) {
    (void)Ask(RequestOf(Kind::kRestart), context);
    PrintOut(context.Said(say::cli::Restarting()) + "\n");
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
