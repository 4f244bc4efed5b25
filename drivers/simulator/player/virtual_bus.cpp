// SPDX-License-Identifier: Apache-2.0
#include "drivers/simulator/player/virtual_bus.hpp"

#include <algorithm>
#include <deque>
#include <exception>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace plumb::simulated {
namespace {

/// @throws std::invalid_argument for an unknown name.
Glitch ParseGlitch(const std::string& name) {
  if (name == "late") return Glitch::kLate;
  if (name == "double") return Glitch::kDouble;
  if (name == "old") return Glitch::kOld;
  if (name == "size") return Glitch::kSize;
  if (name == "lone") return Glitch::kLone;
  throw std::invalid_argument("unknown glitch " + name);
}

}  // namespace

VirtualBus::VirtualBus(std::shared_ptr<Stage> stage, std::string serial, std::string second)
    : stage_(std::move(stage)),
      default_serial_(std::move(serial)),
      second_serial_(std::move(second)) {}

void VirtualBus::SetListener(Listener listener) {
  const std::lock_guard lock(mutex_);
  listener_ = std::move(listener);
}

std::string VirtualBus::Obey(const std::string& line) try {
  std::istringstream words(line);
  std::string verb, argument;
  words >> verb >> argument;
  const auto show = [this](std::size_t scene) {
    stage_->Show(scene, Stage::Motion::kStill);
    return "ok";
  };
  if (verb == "plug") return Plug(argument.empty() ? default_serial_ : argument);
  if (verb == "unplug") return Unplug(argument);
  if (verb == "next-scene") return show(stage_->Now().index + 1);
  if (verb == "scene") return show(std::stoul(argument));
  if (verb == "mount" || verb == "move") {
    const std::size_t loop = verb == "mount" ? 0 : argument.empty() ? 1 : std::stoul(argument);
    return stage_->ShowAtRest(loop) ? "ok" : "refused: nothing at rest to show";
  }
  if (verb == "hold") return show(stage_->Now().index);
  if (verb == "rewind") {
    std::int64_t origin_us = 0;
    words >> origin_us;
    // A stamp before 0 is as good as none.
    return Rewind(argument, words && origin_us >= 0 ? std::optional(origin_us) : std::nullopt);
  }
  if (verb == "state") return State();
  if (verb == "speed") return SetSpeed(std::stod(argument));
  if (verb == "glitch") {
    int count = 1;
    if (!(words >> count)) count = 1;
    return OnUnit("", [&, glitch = ParseGlitch(argument)](Unit& unit) {
      unit.glitch = glitch;
      unit.glitches_left = std::clamp(count, 0, 10000);
    });
  }
  if (verb == "hang") {
    hangs_ = true;
    return "ok";
  }
  if (verb == "stall") {
    return OnUnit(argument, [](Unit& unit) {
      const BetweenFrames between_frames(unit);
      unit.stalled = true;
    });
  }
  if (verb == "error") return SetFailed(argument, true);
  if (verb == "resume") return SetFailed(argument, false);
  return "refused: unknown command " + verb;
} catch (const std::exception&) {
  return "refused: cannot understand the argument of " + line;
}

std::string VirtualBus::Rewind(const std::string& how, std::optional<std::int64_t> origin_us) {
  const bool once = how == "once";
  const std::vector<std::shared_ptr<Unit>> all = units();
  // A stall ends with the first frame of the sweep, neither before it nor after it.
  std::deque<BetweenFrames> between_frames;  // of elements that cannot move
  if (once)
    for (const auto& unit : all) between_frames.emplace_back(*unit);
  stage_->Show(stage_->Now().index, once ? Stage::Motion::kSweepOnce : Stage::Motion::kSweep,
               origin_us);
  if (once)
    for (const auto& unit : all) unit->stalled = false;
  return "ok";
}

std::string VirtualBus::SetSpeed(double speed) {
  if (!(speed >= 0 && speed <= 1000)) return "refused: speed must be 0 to 1000";
  stage_->SetSpeed(speed);
  return "ok";
}

std::string VirtualBus::State() const {
  const Stage::View view = stage_->Now();
  std::ostringstream text;
  text << "ok scene=" << view.index << " scenes=" << stage_->size()
       << " frames=" << view.scene->shape().num_frames;
  for (const auto& unit : units()) {
    const std::optional<std::uint32_t> position = unit->position;
    text << " unit=" << unit->serial
         << " position=" << (position ? std::to_string(*position) : "none");
  }
  return text.str();
}

std::string VirtualBus::Plug(const std::string& serial) {
  auto unit = std::make_shared<Unit>();
  {
    const std::lock_guard lock(mutex_);
    if (Find(serial)) return "ok already plugged";
    unit->serial = serial;
    unit->is_second = !second_serial_.empty() && serial == second_serial_;
    unit->uri = "plumb-virtual/" + std::to_string(++num_plugs_);
    units_.push_back(unit);
  }
  Report(*unit, Event::kPlugged);
  return "ok";
}

std::string VirtualBus::Unplug(const std::string& serial) {
  std::shared_ptr<Unit> unit;
  {
    const std::lock_guard lock(mutex_);
    unit = Find(serial);
    if (!unit) return "ok not plugged";
    units_.remove(unit);
  }
  unit->gone = true;
  Report(*unit, Event::kUnplugged);
  return "ok";
}

std::string VirtualBus::SetFailed(const std::string& serial, bool failed) {
  std::shared_ptr<Unit> changed;
  const std::string answer = OnUnit(serial, [&](Unit& unit) {
    unit.failed = failed;
    if (!failed) unit.stalled = false;
    changed = Find(serial);
  });
  if (changed) Report(*changed, failed ? Event::kFailed : Event::kWorksAgain);
  return answer;
}

std::string VirtualBus::OnUnit(const std::string& serial,
                               const std::function<void(Unit&)>& change) {
  const std::lock_guard lock(mutex_);
  const std::shared_ptr<Unit> unit = Find(serial);
  if (!unit) return "refused: no such unit is plugged";
  change(*unit);
  return "ok";
}

// Requires the lock. Empty: the unit that was plugged in first.
std::shared_ptr<Unit> VirtualBus::Find(const std::string& serial) const {
  const auto found = std::find_if(units_.begin(), units_.end(), [&](const auto& unit) {
    return serial.empty() || unit->serial == serial;
  });
  return found == units_.end() ? nullptr : *found;
}

std::vector<std::shared_ptr<Unit>> VirtualBus::units() const {
  const std::lock_guard lock(mutex_);
  return {units_.begin(), units_.end()};
}

std::shared_ptr<Unit> VirtualBus::At(const std::string& uri) const {
  const std::lock_guard lock(mutex_);
  const auto found = std::find_if(units_.begin(), units_.end(),
                                  [&](const auto& unit) { return unit->uri == uri; });
  return found == units_.end() ? nullptr : *found;
}

void VirtualBus::Report(const Unit& unit, Event event) const {
  Listener listener;
  {
    const std::lock_guard lock(mutex_);
    listener = listener_;
  }
  if (listener) listener(unit, event);
}

}  // namespace plumb::simulated
