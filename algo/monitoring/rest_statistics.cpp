// SPDX-License-Identifier: Apache-2.0
#include "algo/monitoring/rest_statistics.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include <Eigen/Cholesky>

#include "algo/base/statistics.hpp"

namespace plumb {
namespace {

constexpr std::size_t kMostFits = 150;
constexpr double kLearned =
    1.1;  // The breathing was learned from the frames that are judged by it.

}  // namespace

Vector6d TwistAbout(const Pose& T, const Eigen::Vector3d& centroid) {
  Vector6d twist;
  twist << VectorFromRotation(T.linear()), T * centroid - centroid;
  return twist;
}

Matrix6d FormalCovariance(const MotionFit& fit) {
  const Matrix6d left = fit.information + Matrix6d::Identity();
  return left.ldlt().solve(Matrix6d::Identity());
}

RestStatistics StatisticsOf(std::span<const MotionFit> fits, const Eigen::Vector3d& centroid) {
  Vector6d mean = Vector6d::Zero(), formal = Vector6d::Zero();
  Matrix6d information = Matrix6d::Zero();
  std::vector<std::vector<double>> residuals(fits.front().views.size());
  std::vector<Vector6d> twists;
  for (const MotionFit& fit : fits) {
    twists.push_back(TwistAbout(fit.T, centroid));
    mean += twists.back();
    const Matrix6d covariance = FormalCovariance(fit);
    formal += covariance.diagonal();
    information += covariance.inverse();
    for (std::size_t i = 0; i < residuals.size(); ++i)
      residuals[i].push_back(fit.views[i].residual);
  }
  const double count = static_cast<double>(fits.size());
  mean /= count;
  // Of single frames, and of means of some: errors that follow the breathing do not average out.
  Vector6d single = Vector6d::Zero(), together = Vector6d::Zero();
  for (std::size_t k = 0; k < twists.size(); ++k) {
    single += (twists[k] - mean).cwiseAbs2() / (count - 1);
    if (k < kFramesOfMean) continue;
    Vector6d sum = Vector6d::Zero();
    for (std::size_t j = k + 1 - kFramesOfMean; j <= k; ++j) sum += twists[j] / kFramesOfMean;
    together += (sum - mean).cwiseAbs2() / (count - kFramesOfMean);
  }
  RestStatistics statistics{
      .T_zero = PoseAbout(centroid, mean),
      .spread = single.cwiseSqrt(),
      .inflation = kLearned * (single.array() / (formal / count).array()).sqrt(),
      .share_of_mean = (together.array() / single.array()).min(1.0).max(1.0 / kFramesOfMean),
      .information = information / count};
  for (std::vector<double>& of_sensor : residuals)
    statistics.residual.push_back(TakeMedian(of_sensor));
  return statistics;
}

RestFits::RestFits(std::vector<std::pair<std::size_t, const SensorAtRest*>> sensors,
                   const Eigen::Vector3d& centroid)
    : sensors_(sensors.begin(), sensors.end()), centroid_(centroid) {
  const std::size_t sets = std::size_t{1} << sensors.size();
  for (std::size_t bits = 1; bits < sets; ++bits) {
    SensorSet set;
    for (std::size_t i = 0; i < sensors.size(); ++i) {
      if ((bits >> i & 1U) != 0) set.push_back(sensors[i].first);
    }
    std::sort(set.begin(), set.end());
    AddJobs(set);
  }
}

void RestFits::AddJobs(const SensorSet& sensors) {
  // As live: each image with the newest one of every other sensor.
  std::vector<std::pair<double, std::size_t>> images;  // time, place in the set
  for (std::size_t i = 0; i < sensors.size(); ++i) {
    for (const double time_s : sensors_.at(sensors[i])->still_times_s())
      images.emplace_back(time_s, i);
  }
  std::sort(images.begin(), images.end());
  std::vector<std::size_t> seen(sensors.size(), 0);  // images of each so far
  std::vector<Job> jobs;
  for (const auto& [time_s, place] : images) {
    ++seen[place];
    if (std::find(seen.begin(), seen.end(), 0U) != seen.end()) continue;
    Job& job = jobs.emplace_back(Job{.sensors = sensors, .frames = seen});
    for (std::size_t& frame : job.frames) --frame;
  }
  if (jobs.size() <= kFramesOfMean) return;
  jobs_.insert(jobs_.end(),
               jobs.end() - static_cast<std::ptrdiff_t>(std::min(jobs.size(), kMostFits)),
               jobs.end());
}

bool RestFits::Make(std::size_t count) {
  const std::size_t end = std::min(jobs_.size(), fits_.size() + count);
  while (fits_.size() < end) {
    const Job& job = jobs_[fits_.size()];
    std::vector<BlockImage> images;
    for (std::size_t i = 0; i < job.sensors.size(); ++i)
      images.push_back(sensors_.at(job.sensors[i])->StillImage(job.frames[i]));
    std::vector<FitView> views;
    for (std::size_t i = 0; i < job.sensors.size(); ++i)
      views.push_back(sensors_.at(job.sensors[i])->StillView(images[i], job.frames[i]));
    fits_.push_back(FitMotion(views, centroid_, {}));
  }
  return fits_.size() == jobs_.size();
}

std::map<SensorSet, RestStatistics> RestFits::Statistics() const {
  std::map<SensorSet, RestStatistics> statistics;
  for (std::size_t begin = 0; begin < jobs_.size();) {
    std::size_t end = begin;
    while (end < jobs_.size() && jobs_[end].sensors == jobs_[begin].sensors) ++end;
    statistics[jobs_[begin].sensors] =
        StatisticsOf(std::span(fits_).subspan(begin, end - begin), centroid_);
    begin = end;
  }
  return statistics;
}

}  // namespace plumb
