// SPDX-License-Identifier: Apache-2.0
// A running plumb-dicomd, and a planning system that sends to it.
#pragma once

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/support/http_client.hpp"
#include "tests/support/process.hpp"
#include "tests/unit/dicom/small_files.hpp"

namespace plumb::testing {

class Dicomd {
 public:
  /// @param folder  Of the test. Gets plumb.toml, with which plumbd is started, too, and spool/.
  /// @param more  Further lines of [dicom].
  explicit Dicomd(std::filesystem::path folder, const std::string& more = {})
      : folder_(std::move(folder)) {
    std::filesystem::create_directory(folder_ / "spool");
    std::ofstream(config()) << fmt::format(
        "[dicom]\nenabled = true\nlisten = \"127.0.0.1:0\"\n"
        "senders = [\"TPS@127.0.0.1\"]\nspool = \"{}\"\n{}",
        (folder_ / "spool").string(), more);
    process_ = std::make_unique<Process>(
        std::vector<std::string>{PLUMB_DICOMD_BINARY, "--config", config().string()});
    EXPECT_TRUE(process_->WaitForStderr(", in the clear")) << process_->err();
    const std::string& said = process_->err();
    port_ = std::stoi(said.substr(said.find(" port ") + 6));
  }

  [[nodiscard]] std::filesystem::path config() const { return folder_ / "plumb.toml"; }

  /// Sends files of these bytes, which must be taken.
  void Send(const std::vector<std::string>& files) {
    const std::filesystem::path sent = folder_ / "sent";
    std::filesystem::create_directory(sent);
    std::vector<std::string> line = {PLUMB_BINARY, "send-dicom"};
    for (const std::string& bytes : files)
      line.push_back(Written(sent / fmt::format("{}.dcm", line.size()), bytes).string());
    for (const std::string& more : {std::string("--from"), std::string("TPS"), std::string("--to"),
                                    fmt::format("PLUMB@127.0.0.1:{}", port_)})
      line.push_back(more);
    const RunResult result = plumb::Run(line);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    std::filesystem::remove_all(sent);
  }

  /// As if everything had come so long ago.
  void SetAge(std::chrono::seconds age) const {
    for (const auto& file : std::filesystem::directory_iterator(folder_ / "spool"))
      std::filesystem::last_write_time(file, std::filesystem::file_time_type::clock::now() - age);
  }

 private:
  std::filesystem::path folder_;
  std::unique_ptr<Process> process_;
  int port_ = 0;
};

/// What a page shows once the appliance has looked, and `enough` holds. It asks again as the page
/// does, because the folder is another account's, and no event tells of it.
inline nlohmann::json Settled(test::HttpClient& client, const std::string& path,
                              const std::function<bool(const nlohmann::json&)>& enough) {
  nlohmann::json found;
  for (int i = 0; i < 1200; ++i) {
    const auto answer = client.Get(path);
    EXPECT_EQ(answer.status, 200) << answer.body;
    found = answer.json();
    if (found.value("is_settled", false) && enough(found)) return found;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  ADD_FAILURE() << path << ": " << found.dump();
  return found;
}

}  // namespace plumb::testing
