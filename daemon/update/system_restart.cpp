// SPDX-License-Identifier: Apache-2.0
#include "daemon/update/system_restart.hpp"

#include <chrono>
#include <utility>

#include "daemon/update/bus.hpp"
#include "words/update.hpp"

namespace plumb {
namespace {

constexpr std::chrono::seconds kRestartTimeout{20};

class LogindRestart : public SystemRestart {
 public:
  LogindRestart(EventLoop& loop, std::string address)
      : bus_(loop, "bus", [this] { Answer(say::update::RestartBusBroke()); }),
        address_(std::move(address)) {}

  void Restart(std::function<void(const Message&)> done) override {
    if (done_) return done(say::update::RestartAsked());
    done_ = std::move(done);
    constexpr int kNotInteractive = 0;  // no dialogue: nobody sits at this machine
    if (!bus_.Open(address_, kRestartTimeout) ||
        sd_bus_call_method_async(bus_.get(), nullptr, "org.freedesktop.login1",
                                 "/org/freedesktop/login1", "org.freedesktop.login1.Manager",
                                 "Reboot", &LogindRestart::OnAnswer, this, "b",
                                 kNotInteractive) < 0) {
      bus_.Close();
      return Answer(say::update::RestartNoBus());
    }
    bus_.Process();
  }

 private:
  static int OnAnswer(sd_bus_message* message, void* self, sd_bus_error*) {
    auto* restart = static_cast<LogindRestart*>(self);
    const sd_bus_error* error = sd_bus_message_get_error(message);
    const auto said = [&] {
      return Message::Verbatim(error->message == nullptr ? error->name : error->message);
    };
    restart->Answer(error == nullptr ? Message() : said());
    return 0;
  }

  void Answer(const Message& why) {
    auto done = std::exchange(done_, nullptr);
    if (!done) return;
    done(why.empty() ? Message() : say::update::NoRestart(why));
  }

  Bus bus_;
  std::string address_;
  std::function<void(const Message&)> done_;
};

}  // namespace

std::unique_ptr<SystemRestart> MakeLogindRestart(EventLoop& loop, const std::string& bus_address) {
  return std::make_unique<LogindRestart>(loop, bus_address);
}

}  // namespace plumb
