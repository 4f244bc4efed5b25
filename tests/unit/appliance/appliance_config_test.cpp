// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include "algo/base/errors.hpp"
#include "algo/comparison/marker_check.hpp"
#include "daemon/config/config.hpp"
#include "tests/support/message_of.hpp"

namespace plumb {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::MessageOf;

TEST(ApplianceConfigTest, EveryKeyIsRead) {
  const Config config = ParseConfig(R"(
[appliance]
state = "/data/plumb"
control = "/run/p.sock"
calibration = "/data/cal"
sensor_serial = "1804060024"
sensor_profiles = false
quota_gb = 12.5
warm_up_min = 20
session_idle_min = 45
[storage]
backup_folder = "/mnt/backup"
backup_hours = 12
backup_recipients = ["age1z8q8p3f3getd6h87azd0zc2vzskwttwywjqumzv8yqddd73pwg3svc56n6"]
backup_key_file = "/etc/plumb/backup.key"
[button]
chip = "gpiochip1"
line = "start"
active_low = false
[light]
green = "#17"
beeper = "beep"
[web]
listen = "[::]:8443"
tls_certificate = "/etc/plumb/cert.pem"
tls_key = "/etc/plumb/key.pem"
host_names = ["plumb.local", "couch"]
)",
                                    "test.toml");
  EXPECT_EQ(config.appliance.state, "/data/plumb");
  EXPECT_EQ(config.appliance.control, "/run/p.sock");
  EXPECT_EQ(config.appliance.calibration, "/data/cal");
  EXPECT_EQ(config.appliance.sensor_serial, "1804060024");
  EXPECT_FALSE(config.appliance.sensor_profiles);
  EXPECT_TRUE(Config().appliance.sensor_profiles);
  EXPECT_EQ(config.appliance.quota_gb, 12.5);
  EXPECT_EQ(config.appliance.backup_folder, "/mnt/backup");
  EXPECT_EQ(config.appliance.backup_hours, 12);
  EXPECT_EQ(config.appliance.backup_key_file, "/etc/plumb/backup.key");
  EXPECT_EQ(config.appliance.backup_recipients.keys().size(), 1U);
  EXPECT_EQ(config.appliance.warm_up_min, 20.0);
  EXPECT_EQ(config.appliance.session_idle_min, 45.0);
  EXPECT_EQ(config.panel.button_chip, "gpiochip1");
  EXPECT_EQ(config.panel.button_line, "start");
  EXPECT_FALSE(config.panel.button_active_low);
  EXPECT_EQ(config.panel.green_line, "#17");
  EXPECT_EQ(config.panel.beeper_line, "beep");
  EXPECT_EQ(config.panel.red_line, "");
  EXPECT_EQ(config.web.listen, "[::]:8443");
  EXPECT_EQ(config.web.tls_key, "/etc/plumb/key.pem");
  EXPECT_THAT(config.web.host_names, ElementsAre("plumb.local", "couch"));
}

TEST(ApplianceConfigTest, TheShareOfMarkersThatACheckMustSeeIsThatOfTheFile) {
  Scene room;
  room.room_markers = {.dictionary = "DICT_6X6_250", .length_m = 0.1};
  room.calibration["depth_scale"] = 1.0;
  for (int id = 0; id < 10; ++id) {
    SceneMarker& marker = room.markers[id];
    marker.num_views = 10;
    marker.corners = CornersInMarkerFrame(0.1);
    for (Eigen::Vector3d& corner : marker.corners)
      corner += Eigen::Vector3d(0.3 * (id % 4), 0.3 * (id / 4), 0);
  }
  const MarkerBaseline baseline = BaselineOf(room);
  room.markers.erase(9);
  const auto status = [&](const std::string& text) {
    return CheckMarkers(room, baseline, ParseConfig(text, "plumb.toml").check).status;
  };
  EXPECT_EQ(status(""), MarkerCheckStatus::kPassed);
  EXPECT_EQ(status("[check]\nmin_seen = 0.9\n"), MarkerCheckStatus::kPassed);
  EXPECT_EQ(status("[check]\nmin_seen = 0.91\n"), MarkerCheckStatus::kFailed);
}

TEST(ApplianceConfigTest, WhatIsWrongIsToldWithItsLine) {
  const auto complaint = [](const std::string& text) {
    return MessageOf<DataError>([&] { (void)ParseConfig(text, "plumb.toml"); });
  };
  EXPECT_THAT(complaint("[appliance]\n\nstate = \"relative\"\n"),
              AllOf(HasSubstr("plumb.toml:3"), HasSubstr("absolute"), HasSubstr("relative")));
  EXPECT_THAT(complaint("[appliance]\nwarm_up_min = 1000\n"),
              AllOf(HasSubstr(":2"), HasSubstr("minutes from 0 to 120")));
  EXPECT_THAT(complaint("[storage]\nbackup_hours = 0.5\n"), HasSubstr("1 to 8760"));
  EXPECT_THAT(complaint("[storage]\nbackup_folder = \"usb\"\n"), HasSubstr("absolute"));
  EXPECT_THAT(complaint("[storage]\nbackup_key_file = \"key\"\n"), HasSubstr("absolute"));
  for (const char* keys : {"\"age1\"", "[\"age1\"]", "[\"ssh-ed25519 AAAA\"]", "[7]"})
    EXPECT_THAT(complaint(fmt::format("[storage]\n\nbackup_recipients = {}\n", keys)),
                AllOf(HasSubstr("plumb.toml:3"), HasSubstr("public keys of age")));
  EXPECT_THAT(complaint("[appliance]\nquota = 3\n"),
              AllOf(HasSubstr(":2"), HasSubstr("unknown key 'quota'"), HasSubstr("quota_gb")));
  EXPECT_THAT(complaint("[web]\nlisten = \"8080\"\n"),
              AllOf(HasSubstr(":2"), HasSubstr("0.0.0.0:8080")));
  EXPECT_THAT(complaint("[web]\nhost_names = [1]\n"), HasSubstr(":2"));
  EXPECT_THAT(complaint("[gpio]\n"), HasSubstr("[appliance]"));
}

TEST(ApplianceConfigTest, ListenAddresses) {
  EXPECT_EQ(ParseListenAddress("127.0.0.1:8080")->port, 8080);
  EXPECT_EQ(ParseListenAddress("[::1]:0")->address, "::1");
  for (const char* bad : {"", ":80", "80", "host:", "1.2.3.4:65536", "1.2.3.4:x", "::1:80",
                          "[::1:80", "[1.2.3.4]:80", "a:-1"}) {
    EXPECT_FALSE(ParseListenAddress(bad)) << bad;
  }
}

}  // namespace
}  // namespace plumb
