// SPDX-License-Identifier: Apache-2.0
// The restart through a logind of the test's own.
#include "daemon/update/system_restart.hpp"

#include <systemd/sd-bus.h>

#include <atomic>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/bus_service.hpp"
#include "tests/support/private_bus.hpp"
#include "tests/support/temp_folder.hpp"

namespace plumb {
namespace {

using ::testing::HasSubstr;

/// Name, path, interface and signature are logind's.
class FakeLogind {
 public:
  std::atomic<int> num_reboots{0};
  std::atomic<bool> asks_for_a_password{false};

  explicit FakeLogind(const std::string& address)
      : service_(address, {.name = "org.freedesktop.login1",
                           .path = "/org/freedesktop/login1",
                           .interface = "org.freedesktop.login1.Manager",
                           .table = kTable,
                           .self = this}) {}

 private:
  static int Reboot(sd_bus_message* message, void* self, sd_bus_error* error) {
    auto* logind = static_cast<FakeLogind*>(self);
    int interactive = -1;
    sd_bus_message_read(message, "b", &interactive);
    if (logind->asks_for_a_password || interactive != 0)
      return sd_bus_error_set(error, "org.freedesktop.DBus.Error.InteractiveAuthorizationRequired",
                              "Interactive authentication required.");
    ++logind->num_reboots;
    return sd_bus_reply_method_return(message, "");
  }
  static inline const sd_bus_vtable kTable[] = {
      SD_BUS_VTABLE_START(0),
      SD_BUS_METHOD("Reboot", "b", "", &FakeLogind::Reboot, SD_BUS_VTABLE_UNPRIVILEGED),
      SD_BUS_VTABLE_END};

  testing::BusService service_;
};

class SystemRestartTest : public ::testing::Test {
 protected:
  /// The answer to one restart; none within half a minute is a failure of the test.
  std::string Restart() {
    std::optional<std::string> answer;
    const auto restart = MakeLogindRestart(loop_, bus_.address());
    restart->Restart([&](const Message& failure) {
      answer = failure.English();
      loop_.Quit(0);
    });
    EventLoop::Source limit = loop_.MakeTimer("limit", [&] { loop_.Quit(1); });
    limit.ArmAfter(std::chrono::seconds(30));
    if (!answer) loop_.Run();
    return answer.value_or("no answer");
  }

  EventLoop loop_;  // first: blocks signals before any thread starts
  testing::TempFolder folder_;
  testing::PrivateBus bus_{folder_.path()};
};

TEST_F(SystemRestartTest, LogindIsAskedOnce) {
  FakeLogind logind(bus_.address());
  EXPECT_EQ(Restart(), "");
  EXPECT_EQ(logind.num_reboots, 1);
}

TEST_F(SystemRestartTest, ItsRefusalIsSaidWithWhatToDo) {
  FakeLogind logind(bus_.address());
  logind.asks_for_a_password = true;
  EXPECT_THAT(Restart(), ::testing::AllOf(HasSubstr("cannot be restarted from here"),
                                          HasSubstr("Interactive authentication required"),
                                          HasSubstr("at its console")));
  EXPECT_EQ(logind.num_reboots, 0);
}

TEST_F(SystemRestartTest, ABusWithoutLogindIsAnAnswerToo) {
  EXPECT_THAT(Restart(), HasSubstr("cannot be restarted from here"));
}

TEST_F(SystemRestartTest, AMachineWithoutABusToo) {
  bus_.Stop();
  EXPECT_THAT(Restart(), HasSubstr("no system bus"));
}

}  // namespace
}  // namespace plumb
