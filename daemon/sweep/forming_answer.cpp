// SPDX-License-Identifier: Apache-2.0
#include "daemon/sweep/forming_answer.hpp"

#include <array>
#include <cstddef>
#include <exception>
#include <utility>

#include <tbb/task_arena.h>

#include "algo/base/units.hpp"
#include "daemon/loop/give_way.hpp"

namespace plumb {

namespace {

/// Nothing where the markers are fixed to the couch, because shifts are not known then.
std::optional<MotionNumbers> NumbersOf(const Correction& correction) {
  const auto six = [](const CouchNumbers& numbers) {
    return std::array<std::optional<double>, kNumberAxes.size()>{
        numbers.vertical_mm, numbers.longitudinal_mm, numbers.lateral_mm,
        numbers.pitch_deg,   numbers.roll_deg,        numbers.yaw_deg};
  };
  MotionNumbers shown;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const auto value = six(correction.value)[i], u95 = six(correction.u95)[i];
    if (!value || !u95) return std::nullopt;
    shown.value[i] = *value;
    shown.u95[i] = *u95;
  }
  return shown;
}

}  // namespace

FormingAnswer FormingAnswerOf(const Comparison& comparison, double sweep_s) {
  FormingAnswer answer;
  answer.sweep_s = sweep_s;
  answer.shift_tolerance_mm = comparison.limits.shift_tolerance_m / kMillimetre;
  answer.rotation_tolerance_deg = comparison.limits.rotation_tolerance_rad / kDegree;
  if (comparison.verdict == Verdict::kNoAnswer || !comparison.correction) return answer;
  const std::optional<MotionNumbers> numbers = NumbersOf(*comparison.correction);
  if (!numbers) return answer;
  answer.numbers = numbers;
  answer.is_enough = comparison.verdict != Verdict::kUnsure;
  for (std::size_t i = 0; i < kNumberAxes.size(); ++i) {
    const double tolerance =
        kNumberAxes[i].is_shift() ? answer.shift_tolerance_mm : answer.rotation_tolerance_deg;
    answer.is_enough = answer.is_enough && numbers->u95[i] < kEnoughShare * tolerance;
  }
  return answer;
}

FormingAnswers::FormingAnswers(CompareScene compare)
    : compare_(std::move(compare)), thread_([this](const std::stop_token& stop) { Run(stop); }) {}

FormingAnswers::~FormingAnswers() { Stop(); }

bool FormingAnswers::IsIdle() const {
  const std::scoped_lock lock(mutex_);
  return !wanted_;
}

void FormingAnswers::Make(MakeScene scene, double sweep_s) {
  const std::scoped_lock lock(mutex_);
  wanted_ = std::move(scene);
  wanted_sweep_s_ = sweep_s;
  wakes_.notify_one();
}

std::optional<FormingAnswer> FormingAnswers::Newest() const {
  const std::scoped_lock lock(mutex_);
  return newest_;
}

void FormingAnswers::Stop() { thread_.request_stop(); }

void FormingAnswers::Run(const std::stop_token& stop) {
  GiveWayToScans();
  // Its parallel loops run on this thread alone, at its priority, not on those of tracking.
  tbb::task_arena alone(1);
  std::unique_lock lock(mutex_);
  while (wakes_.wait(lock, stop, [this] { return static_cast<bool>(wanted_); })) {
    const MakeScene make = wanted_;
    const double sweep_s = wanted_sweep_s_;
    lock.unlock();
    std::optional<FormingAnswer> made;
    try {
      alone.execute([&] { made = FormingAnswerOf(compare_(make(stop), stop), sweep_s); });
    } catch (const std::exception&) {
      // Too little was seen yet, or it was stopped: the sweep's own end reports errors.
    }
    lock.lock();
    if (made && made->numbers) {
      newest_ = made;
    } else if (made && newest_) {
      newest_->is_enough = false;  // what was seen since then gives no answer any more
    }
    wanted_ = {};
  }
}

}  // namespace plumb
