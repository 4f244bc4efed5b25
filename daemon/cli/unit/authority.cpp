// SPDX-License-Identifier: Apache-2.0
// `plumb authority`: prints the certificate that tablets need to trust this unit.
#include <filesystem>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "algo/base/errors.hpp"
#include "daemon/cli/commands.hpp"
#include "drivers/files/file_io.hpp"
#include "words/cli.hpp"

namespace plumb {

Command AddAuthority(CLI::App& app) {
  auto state = std::make_shared<std::filesystem::path>("/var/lib/plumb");
  app.add_option("--state", *state, "State folder of plumbd")
      ->type_name("DIR")
      ->capture_default_str();
  return [state](const CommandContext&) {
    constexpr std::size_t kMaxBytes = 64 << 10;
    const std::filesystem::path file = *state / "page-authority.pem";
    const std::string end = "-----END CERTIFICATE-----\n";
    // The private key follows the certificate in this file and must not be printed.
    const std::string text =
        std::filesystem::exists(file) ? ReadTextFile(file, kMaxBytes) : std::string();
    const std::size_t last = text.find(end);
    if (!text.starts_with("-----BEGIN CERTIFICATE-----") || last == std::string::npos)
      throw DataError(say::cli::NoOwnAuthority(state->string()));
    PrintOut(text.substr(0, last + end.size()));
    return static_cast<int>(kDone);
  };
}

}  // namespace plumb
