// SPDX-License-Identifier: Apache-2.0
// A unit that scans while Prometheus reads its metrics and a collector takes its journal.
#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <stop_token>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "drivers/files/descriptor.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/skip.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using testing::Plumbd;

constexpr const char* kCollector = "/lib/systemd/systemd-journal-remote";

/// In the place of the journal: keeps each entry in the format in which journals are exported,
/// which is that of the journal's socket with a time and a boot before it.
class Journal {
 public:
  /// @param log  Gets the messages, too.
  Journal(const fs::path& socket, fs::path exported, fs::path log)
      : exported_(std::move(exported)),
        log_(std::move(log)),
        socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un at{};
    at.sun_family = AF_UNIX;
    std::strncpy(at.sun_path, socket.c_str(), sizeof at.sun_path - 1);
    if (::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&at), sizeof at) != 0)
      throw std::runtime_error("no socket for a journal");
    thread_ = std::jthread([this](const std::stop_token& stop) { Run(stop); });
  }

 private:
  void Run(const std::stop_token& stop) {
    while (!stop.stop_requested()) {
      pollfd ready{.fd = socket_.get(), .events = POLLIN, .revents = 0};
      if (::poll(&ready, 1, 50) <= 0) continue;
      std::array<char, 65536> bytes{};
      const ssize_t size = ::recv(socket_.get(), bytes.data(), bytes.size(), 0);
      if (size <= 0) continue;
      const std::string entry(bytes.data(), static_cast<std::size_t>(size));
      timespec now{};
      ::clock_gettime(CLOCK_REALTIME, &now);
      std::ofstream(exported_, std::ios::app)
          << fmt::format("__REALTIME_TIMESTAMP={}\n__MONOTONIC_TIMESTAMP={}\n_BOOT_ID={:032x}\n",
                         now.tv_sec * 1'000'000LL + now.tv_nsec / 1000, ++count_, 1)
          << entry << "\n";
      constexpr std::string_view kMessage = "MESSAGE=";
      std::ofstream(log_, std::ios::app)
          << entry.substr(kMessage.size(), entry.find('\n') - kMessage.size()) << "\n";
    }
  }

  const fs::path exported_, log_;
  const Descriptor socket_;
  long count_ = 0;
  std::jthread thread_;  // last: it uses the members above
};

/// Prometheus with the alerts of the documentation, which asks the unit each second.
class Prometheus {
 public:
  Prometheus(const fs::path& folder, std::uint16_t unit, const fs::path& token)
      : port_(static_cast<std::uint16_t>(testing::FreePort())), client_(port_) {
    std::ofstream(folder / "prometheus.yml") << fmt::format(
        "global: {{scrape_interval: 1s, evaluation_interval: 1s}}\n"
        "rule_files: [\"{}\"]\n"
        "scrape_configs:\n"
        "  - job_name: plumb\n"
        "    authorization: {{credentials_file: \"{}\"}}\n"
        "    static_configs: [{{targets: [\"127.0.0.1:{}\"]}}]\n",
        (fs::path(PLUMB_SOURCE_DIR) / "docs" / "watching" / "plumb-alerts.yml").string(),
        token.string(), unit);
    process_ = std::make_unique<Process>(
        std::vector<std::string>{kProgram, "--config.file=" + (folder / "prometheus.yml").string(),
                                 "--storage.tsdb.path=" + (folder / "prometheus").string(),
                                 fmt::format("--web.listen-address=127.0.0.1:{}", port_)});
    EXPECT_TRUE(process_->WaitForStderr("Server is ready")) << process_->err();
  }

  /// The answer to a query: its values.
  json Query(const std::string& expression) {
    std::string encoded;
    for (const char c : expression)
      encoded += std::isalnum(static_cast<unsigned char>(c)) != 0
                     ? std::string(1, c)
                     : fmt::format("%{:02X}", static_cast<unsigned char>(c));
    const json answer = client_.Get("/api/v1/query?query=" + encoded).json();
    EXPECT_EQ(answer.value("status", ""), "success") << expression << ": " << answer;
    return answer["data"]["result"];
  }
  /// Of an expression that has one value; NaN if it has none.
  double ValueOf(const std::string& expression) {
    const json found = Query(expression);
    return found.size() == 1 ? std::stod(found[0]["value"][1].get<std::string>())
                             : std::numeric_limits<double>::quiet_NaN();
  }
  json Rules() {
    const json answer = client_.Get("/api/v1/rules").json();
    return answer["data"]["groups"][0]["rules"];
  }

  static constexpr const char* kProgram = "/usr/bin/prometheus";

 private:
  std::uint16_t port_;
  test::HttpClient client_;
  std::unique_ptr<Process> process_;
};

TEST(DaemonWatchedTest, PrometheusAndACollectorReadAUnitThatScansAndLoseItNoFrame) {
  if (!fs::exists(Prometheus::kProgram) || !fs::exists(kCollector))
    PLUMB_SKIP("not installed: apt install prometheus systemd-journal-remote");
  const testing::TempFolder folder;
  std::ofstream(folder / "token") << std::string(40, 't') << "\n";
  fs::permissions(folder / "token", fs::perms::owner_read);
  std::ofstream(folder / "plumb.toml")
      << "[web]\nmetrics_token_file = \"" << (folder / "token").string() << "\"\n";
  // plumbd speaks to the journal where its standard error is the journal's.
  std::ofstream(folder / "log") << "";
  struct stat log {};
  ASSERT_EQ(::stat((folder / "log").c_str(), &log), 0);
  Journal journal(folder / "journal", folder / "exported", folder / "log");
  Plumbd plumbd(
      folder.path(),
      {.arguments = {"--config", (folder / "plumb.toml").string()},
       .environment = {{"LD_PRELOAD", PLUMB_JOURNAL_ELSEWHERE},
                       {"PLUMB_JOURNAL", (folder / "journal").string()},
                       {"JOURNAL_STREAM", fmt::format("{}:{}", log.st_dev, log.st_ino)}}});
  ASSERT_TRUE(plumbd.WaitUntilUp());
  plumbd.WaitForState("ready");
  plumbd.WaitForLog("page is served at ");

  Prometheus prometheus(folder.path(), plumbd.port(), folder / "token");
  plumbd.WaitFor("the first metrics",
                 [&](const json&) { return prometheus.ValueOf("plumb_healthy") == 1; });
  const json ended = plumbd.ScanOnce()["last_result"];
  EXPECT_EQ(ended["frames_dropped"], 0);
  plumbd.WaitFor("the metrics of the scan",
                 [&](const json&) { return prometheus.ValueOf("sum(plumb_scans_total)") == 1; });
  EXPECT_EQ(prometheus.ValueOf("plumb_frames_total"), ended["frames"].get<double>());
  EXPECT_EQ(prometheus.ValueOf("plumb_frames_dropped_total"), 0);
  EXPECT_GT(prometheus.ValueOf("plumb_answer_seconds"), 0);
  EXPECT_EQ(prometheus.ValueOf("up{job=\"plumb\"}"), 1);

  // What is not there without a check, a backup or two scans in an hour.
  const std::set<std::string> empty = {"Check values by their limits", "Age of the newest backup"};
  std::ifstream file(fs::path(PLUMB_SOURCE_DIR) / "docs" / "watching" / "plumb-dashboard.json");
  const json dashboard = json::parse(file);
  for (const json& panel : dashboard.at("panels"))
    for (const json& target : panel.at("targets"))
      EXPECT_EQ(prometheus.Query(target["expr"]).empty(), empty.contains(panel["title"]))
          << panel["title"];
  plumbd.WaitFor("the alerts", [&](const json&) {
    for (const json& rule : prometheus.Rules())
      if (rule["health"] != "ok") return false;
    return true;
  });
  for (const json& rule : prometheus.Rules())
    if (rule["name"] == "PlumbIsDown" || rule["name"] == "PlumbIsNotHealthy" ||
        rule["name"] == "PlumbLosesFrames") {
      EXPECT_EQ(rule["state"], "inactive") << rule;
    }

  EXPECT_EQ(plumbd.Stop(), 0);
  const RunResult collected =
      plumb::Run({kCollector, "--output", folder / "collected.journal", folder / "exported"});
  ASSERT_EQ(collected.exit_code, 0) << collected.err;
  const RunResult shown =
      plumb::Run({"/bin/journalctl", "--file", folder / "collected.journal", "--output", "json"});
  ASSERT_EQ(shown.exit_code, 0) << shown.err;
  EXPECT_THAT(shown.out, HasSubstr("\"SYSLOG_IDENTIFIER\":\"plumbd\""));
  EXPECT_THAT(shown.out, HasSubstr("is ready; research use only"));
  EXPECT_THAT(shown.out, HasSubstr("\"PLUMB_SCAN\":\"000001\""));
}

}  // namespace
}  // namespace plumb
