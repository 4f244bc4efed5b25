// SPDX-License-Identifier: Apache-2.0
// The answer that forms while one sweeps: numbers of what was seen so far, and whether that is
// enough.
#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "algo/comparison/comparison.hpp"
#include "algo/types/scene.hpp"
#include "web/model/forming_answer.hpp"

namespace plumb {

/// What a comparison of a part of a sweep says to the person who sweeps.
///
/// It is enough when the verdict is decided and each half-width of an interval is below
/// kEnoughShare of its tolerance, so that going on would change neither.
[[nodiscard]] FormingAnswer FormingAnswerOf(const Comparison& comparison, double sweep_s);
inline constexpr double kEnoughShare = 0.5;

/// Makes them one at a time on a thread of its own, which gets the processor time that nothing else
/// wants: tracking loses no frame to it. Call all functions from one thread, the tracking one.
class FormingAnswers {
 public:
  using MakeScene = std::function<Scene(const std::stop_token&)>;
  using CompareScene = std::function<Comparison(const Scene&, const std::stop_token&)>;

  explicit FormingAnswers(CompareScene compare);
  ~FormingAnswers();
  FormingAnswers(const FormingAnswers&) = delete;
  FormingAnswers& operator=(const FormingAnswers&) = delete;

  /// False while one is being made.
  [[nodiscard]] bool IsIdle() const;
  /// @param sweep_s  Time from the first to the last of its frames.
  void Make(MakeScene scene, double sweep_s);
  /// Nothing before one was reached. What gives no answer leaves the one before it.
  [[nodiscard]] std::optional<FormingAnswer> Newest() const;
  /// Gives up what is being made, without waiting.
  void Stop();

 private:
  void Run(const std::stop_token& stop);

  CompareScene compare_;
  mutable std::mutex mutex_;
  std::condition_variable_any wakes_;
  MakeScene wanted_;  ///< Set until it was made.
  double wanted_sweep_s_ = 0.0;
  std::optional<FormingAnswer> newest_;
  std::jthread thread_;  // last: starts when the members above are initialised
};

}  // namespace plumb
