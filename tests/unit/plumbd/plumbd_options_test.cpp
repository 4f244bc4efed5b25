// SPDX-License-Identifier: Apache-2.0
#include "daemon/plumbd/plumbd_options.hpp"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "drivers/files/file_io.hpp"
#include "drivers/live/sensor_driver.hpp"
#include "tests/support/temp_folder.hpp"
#include "web/model/limits.hpp"

namespace plumb {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class UnusableConfigurationTest : public ::testing::Test {
 protected:
  Configured Read(const std::string& text) {
    options_.config_file = folder_ / "plumb.toml";
    WriteWholeFile(*options_.config_file, std::string_view(text));
    return ReadOrExplain(options_, BuiltInSensors());
  }

  testing::TempFolder folder_;
  PlumbdOptions options_;
};

constexpr const char* kPanelAndPage = R"(
[button]
line = "start"
[light]
chip = "gpiochip2"
red = "#17"
[web]
listen = "10.0.0.5:8443"
host_names = ["couch"]
)";

TEST_F(UnusableConfigurationTest, LightButtonAndPageStayWhereTheFileSays) {
  const Configured read =
      Read(std::string(kPanelAndPage) + "[appliance]\nquota_gb = 7\nquotas = 3\n[sensr]\nx = 1\n");
  EXPECT_THAT(read.fault.English(), HasSubstr("sensr"));
  EXPECT_EQ(read.config.panel.button_line, "start");
  EXPECT_EQ(read.config.panel.light_chip, "gpiochip2");
  EXPECT_EQ(read.config.panel.red_line, "#17");
  EXPECT_EQ(read.config.web.listen, "10.0.0.5:8443");
  EXPECT_THAT(read.config.web.host_names, ElementsAre("couch"));
  EXPECT_EQ(read.config.appliance.quota_gb, ApplianceConfig{}.quota_gb) << "nothing else is taken";
}

TEST_F(UnusableConfigurationTest, TheCommandLineOverridesThePlaceOfThePage) {
  options_.listen = "127.0.0.1:0";
  const Configured read = Read(std::string(kPanelAndPage) + "[appliance]\nquotas = 3\n");
  EXPECT_EQ(read.config.web.listen, "127.0.0.1:0");
  EXPECT_THAT(read.config.web.host_names, ElementsAre("couch"));
}

TEST_F(UnusableConfigurationTest, AnErrorInOneTableLeavesTheOthers) {
  const Configured read =
      Read("[button]\nline = 3\n[light]\nred = \"#17\"\n[web]\nlisten = \"127.0.0.1:9000\"\n");
  EXPECT_THAT(read.fault.English(), HasSubstr("button.line"));
  EXPECT_EQ(read.config.panel.button_line, "");
  EXPECT_EQ(read.config.panel.red_line, "#17");
  EXPECT_EQ(read.config.web.listen, "127.0.0.1:9000");
}

TEST_F(UnusableConfigurationTest, ACertificateThatCannotBeUsedIsReplacedByAnOwnOne) {
  const Configured read = Read(
      "[web]\nlisten = \"10.0.0.5:8443\"\ntls_certificate = \"/nonexistent/cert.pem\"\n"
      "tls_key = \"/nonexistent/key.pem\"\n");
  EXPECT_THAT(read.fault.English(), HasSubstr("/nonexistent"));
  EXPECT_EQ(read.config.web.listen, "10.0.0.5:8443");
  EXPECT_TRUE(read.config.web.tls_certificate.empty());
}

TEST_F(UnusableConfigurationTest, AFileThatIsNoTomlGivesTheDefaults) {
  const Configured read = Read("[light\nred = \"#17\"\n");
  EXPECT_THAT(read.fault.English(), HasSubstr("plumb.toml"));
  EXPECT_EQ(read.config.panel.red_line, "");
  EXPECT_EQ(read.config.web.listen, WebConfig{}.listen);
}

TEST_F(UnusableConfigurationTest, TheFirstSettingsAreThoseOfTheFileWithinTheLimitsOfSettings) {
  const Configured given = Read(
      "[appliance]\nauto_stop_s = 2.5\nscan_limit_s = 3600\nkeep_recordings = true\n"
      "code_check_character = true\n");
  EXPECT_EQ(given.fault.English(), "");
  const Settings first = FirstSettings(given.config.appliance);
  EXPECT_EQ(first.auto_stop_s, 2.5);
  EXPECT_EQ(first.scan_limit_s, 3600);
  EXPECT_TRUE(first.keep_recordings);
  EXPECT_TRUE(first.code_check_character);
  EXPECT_FALSE(FirstSettings(ApplianceConfig{}).code_check_character);
  for (const auto& [key, limits] :
       {std::pair("auto_stop_s", kAutoStop_s), {"scan_limit_s", kScanLimit_s}}) {
    const auto fault = [&, key = key](double value) {
      return Read(fmt::format("[appliance]\n{} = {}\n", key, value)).fault.English();
    };
    EXPECT_EQ(fault(limits.stored.least), "");
    EXPECT_EQ(fault(limits.stored.most), "");
    for (const double outside : {0.9 * limits.stored.least, 1.01 * limits.stored.most})
      EXPECT_THAT(fault(outside), HasSubstr(fmt::format("plumb.toml:2: appliance.{}", key)));
  }
  EXPECT_EQ(FirstSettings({}).auto_stop_s, Settings{}.auto_stop_s);
}

}  // namespace
}  // namespace plumb
