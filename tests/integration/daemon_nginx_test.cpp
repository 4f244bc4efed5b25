// SPDX-License-Identifier: Apache-2.0
// Debian's nginx in front of a real plumbd, by the site of toolchain/nginx.conf.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/fake_peer.hpp"
#include "tests/support/free_port.hpp"
#include "tests/support/http_client.hpp"
#include "tests/support/plumbd.hpp"
#include "tests/support/process.hpp"
#include "tests/support/self_signed.hpp"
#include "tests/support/skip.hpp"

namespace plumb {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using test::HttpAnswer;
using test::HttpClient;
using test::HttpConnection;
using test::kPassword;
using ::testing::HasSubstr;
using testing::Plumbd;

constexpr const char* kNginx = "/usr/sbin/nginx";
constexpr const char* kSite = "plumb.clinic.example";

std::string Read(const fs::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

void Replace(std::string& text, const std::string& what, const std::string& by) {
  const std::size_t at = text.find(what);
  ASSERT_NE(at, std::string::npos) << what << " is not in the site";
  text.replace(at, what.size(), by);
}

/// One that needs no rights and leaves nothing outside the test's folder. Beside the site's own
/// port it listens on one without TLS, for clients of tests.
class Nginx {
 public:
  /// @param site  With its own names of files.
  Nginx(const fs::path& folder, std::string site) {
    Replace(site, "listen 443 ssl;", fmt::format("listen 127.0.0.1:{} ssl;", tls_port_));
    Replace(site, "listen [::]:443 ssl;", fmt::format("listen 127.0.0.1:{};", plain_port_));
    fs::create_directory(folder);
    const fs::path file = folder / "nginx.conf";
    std::ofstream(file) << "daemon off;\nmaster_process off;\nerror_log stderr notice;\npid "
                        << folder.string() << "/pid;\nevents {}\nhttp {\naccess_log off;\n"
                        << Paths(folder) << site << "}\n";
    process_ = std::make_unique<Process>(std::vector<std::string>{
        kNginx, "-p", folder.string(), "-e", "stderr", "-c", file.string()});
    // Said after it listens.
    EXPECT_TRUE(process_->WaitForStderr("getrlimit")) << process_->err();
  }

  [[nodiscard]] std::uint16_t plain_port() const { return plain_port_; }
  [[nodiscard]] std::uint16_t tls_port() const { return tls_port_; }

 private:
  static std::string Paths(const fs::path& folder) {
    std::string text;
    for (const char* kind : {"client_body", "proxy", "fastcgi", "uwsgi", "scgi"})
      text += fmt::format("{0}_temp_path {1}/{0};\n", kind, folder.string());
    return text;
  }
  const std::uint16_t tls_port_ = static_cast<std::uint16_t>(testing::FreePort()),
                      plain_port_ = static_cast<std::uint16_t>(testing::FreePort());
  std::unique_ptr<Process> process_;
};

class DaemonNginxTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { testing::RenderOnce(); }

  void SetUp() override {
    if (!fs::exists(kNginx)) PLUMB_SKIP("there is no nginx");
    std::ofstream(folder_ / "plumb.toml") << "[web]\nhost_names = [\"" << kSite << "\"]\n";
  }

  /// @param listen  Beyond loopback it has TLS.
  std::unique_ptr<Plumbd> Start(const std::string& listen) {
    auto plumbd = std::make_unique<Plumbd>(
        folder_.path(),
        testing::PlumbdOptions{.arguments = {"--config", (folder_ / "plumb.toml").string()},
                               .listen = listen});
    EXPECT_TRUE(plumbd->WaitUntilUp());
    plumbd->WaitFor("its page", [](const json& status) { return status["page"]["url"] != ""; });
    return plumbd;
  }

  /// The site of toolchain/nginx.conf with the files and the port of the test.
  [[nodiscard]] std::string Site(const Plumbd& plumbd) const {
    std::string site = Read(fs::path(PLUMB_SOURCE_DIR) / "toolchain" / "nginx.conf");
    const auto in_folder = [&](const char* name) { return (folder_ / name).string(); };
    testing::MakeSelfSigned(in_folder("site.pem"), in_folder("site.key"), kSite);
    Replace(site, "/etc/ssl/certs/plumb.clinic.example.pem", in_folder("site.pem"));
    Replace(site, "/etc/ssl/private/plumb.clinic.example.key", in_folder("site.key"));
    const RunResult authority =
        plumb::Run({PLUMB_BINARY, "authority", "--state", plumbd.state().string()});
    std::ofstream(folder_ / "authority.pem") << authority.out;
    Replace(site, "ssl_trusted_certificate /etc/ssl/certs/plumb-authority.pem",
            "ssl_trusted_certificate " + in_folder("authority.pem"));
    Replace(site, "127.0.0.1:8080", fmt::format("127.0.0.1:{}", plumbd.port()));
    return site;
  }

  /// As a browser asks that has opened the page by TLS; test clients speak without.
  static HttpClient Browser(const Nginx& nginx) {
    HttpClient browser(nginx.plain_port());
    browser.extra_headers = {{"Origin", fmt::format("https://127.0.0.1:{}", nginx.plain_port())},
                             {"Sec-Fetch-Site", "same-origin"}};
    return browser;
  }
  static HttpAnswer SetUpBy(HttpClient& browser, const Plumbd& plumbd) {
    return browser.Post(
        "/api/v1/setup",
        {{"code", plumbd.setup_code()}, {"name", "engineer"}, {"password", kPassword}});
  }

  static void ExpectRefusedBy(const Nginx& nginx, const Plumbd& plumbd, const char* words) {
    HttpClient browser = Browser(nginx);
    const HttpAnswer refused = SetUpBy(browser, plumbd);
    EXPECT_EQ(refused.status, 403);
    EXPECT_THAT(refused.body, HasSubstr(words));
  }

  testing::TempFolder folder_;
};

TEST_F(DaemonNginxTest, ThePageIsUsedThroughTheSiteAndEventsComeAsTheyAreSaid) {
  const auto plumbd = Start("0.0.0.0:0");
  const Nginx nginx(folder_ / "nginx", Site(*plumbd));
  const fs::path answer = folder_ / "answer";
  const std::string ask = fmt::format(
      "printf 'GET /health HTTP/1.1\\r\\nHost: {}\\r\\nConnection: close\\r\\n\\r\\n' | timeout 60 "
      "openssl s_client -quiet -connect 127.0.0.1:{} > '{}' 2>&1",
      kSite, nginx.tls_port(), answer.string());
  EXPECT_EQ(std::system(ask.c_str()), 0);
  EXPECT_THAT(Read(answer), HasSubstr("HTTP/1.1 200"));

  HttpClient browser = Browser(nginx);
  ASSERT_EQ(SetUpBy(browser, *plumbd).status, 200);
  browser.FetchToken();
  EXPECT_EQ(browser.Post("/api/v1/checks/open").status, 200) << "a change";

  HttpConnection stream(nginx.plain_port());
  ASSERT_TRUE(stream.Send(fmt::format(
      "GET /api/v1/events HTTP/1.1\r\nHost: {}\r\nCookie: {}\r\n\r\n", kSite, browser.cookie)));
  EXPECT_THAT(stream.ReadUntil("\"state\":\"ready\""), HasSubstr("text/event-stream"));
  // A beat has a few bytes: a proxy that fills a buffer first would hold back hundreds of them.
  for (int i = 0; i < 3; ++i) EXPECT_FALSE(stream.ReadUntil("event: beat").empty());
  plumbd->Sim("unplug");
  EXPECT_FALSE(stream.ReadUntil("\"state\":\"no_sensor\"").empty());
  EXPECT_EQ(plumbd->Stop(), 0);
}

TEST_F(DaemonNginxTest, ARefusalNamesTheProxyThatIsSetUpOtherwise) {
  {
    const auto plumbd = Start("0.0.0.0:0");
    std::string site = Site(*plumbd);
    Replace(site, "proxy_set_header Host $http_host;", "");
    ExpectRefusedBy(Nginx(folder_ / "without-host", site), *plumbd,
                    "behind a proxy, have it pass on the browser's Host");
    site = Site(*plumbd);
    Replace(site, "Host $http_host;", "Host another.clinic.example;");
    const Nginx elsewhere(folder_ / "other-name", site);
    const HttpAnswer unknown = HttpClient(elsewhere.plain_port()).Get("/health");
    EXPECT_EQ(unknown.status, 421);
    EXPECT_THAT(unknown.body, HasSubstr("add the name to its configuration"));
    EXPECT_EQ(plumbd->Stop(), 0);
  }
  const auto plumbd = Start("127.0.0.1:0");
  std::string site = Site(*plumbd);
  Replace(site, "proxy_pass https:", "proxy_pass http:");
  ExpectRefusedBy(Nginx(folder_ / "without-tls", site), *plumbd,
                  "have the proxy use https to the unit");
  EXPECT_EQ(plumbd->Stop(), 0);
}

// The product's site says an hour. A second in its place shows that this is the time that counts:
// nginx by itself would wait for 60, and the unit of this test hangs up before.
TEST_F(DaemonNginxTest, AnAnswerThatTakesLongIsWaitedForAsLongAsTheSiteSays) {
  const auto plumbd = Start("127.0.0.1:0");
  std::string site = Site(*plumbd);
  testing::FakePeer busy([](testing::PeerConnection& unit) {
    unit.ReadTo("\r\n\r\n");
    unit.ReadTo("until the proxy gives up");
  });
  Replace(site, fmt::format("proxy_pass https://127.0.0.1:{}", plumbd->port()),
          fmt::format("proxy_pass http://127.0.0.1:{}", busy.port()));
  Replace(site, "proxy_read_timeout 1h;", "proxy_read_timeout 1s;");
  const Nginx nginx(folder_ / "nginx", site);
  EXPECT_EQ(Browser(nginx).Post("/api/v1/backup").status, 504) << "before the unit hangs up";
  EXPECT_EQ(plumbd->Stop(), 0);
}

}  // namespace
}  // namespace plumb
