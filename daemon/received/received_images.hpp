// SPDX-License-Identifier: Apache-2.0
// The CT images among what plumb-dicomd received, sorted into series.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "algo/base/message.hpp"
#include "web/model/planning.hpp"

namespace plumb {

/// Which image is of which series, as the images state it. Each is read once. Not thread-safe.
class ReceivedImages {
 public:
  /// More images of the folder are not looked at.
  static constexpr std::size_t kMost = 4000;

  /// @param key  For PatientHash().
  explicit ReceivedImages(std::string key) : key_(std::move(key)) {}

  /// A received image, before it is read.
  struct Image {
    std::string name, instance_uid;  ///< As its note states the instance; may be empty.
    std::string received_at, sender, address;
  };
  struct Series {
    ReceivedSeries facts;
    std::string patient_hash;
  };

  /// Forgets what is known of images that are not there any more. True if there were any.
  [[nodiscard]] bool Keep(const std::vector<Image>& images);
  [[nodiscard]] bool IsKnown(const std::string& name) const { return series_of_.contains(name); }
  /// Reads one by plumb-dicom-reader, and keeps what it is or why it cannot be used.
  /// @throws IoError if the reader cannot be started: the image is not known then.
  void Read(const std::filesystem::path& spool, const std::string& name);

  /// Of the images that are known.
  /// @param images  Newest first. Of an instance that was sent twice the newest counts.
  [[nodiscard]] std::vector<Series> SeriesOf(const std::vector<Image>& images) const;
  /// Names of the images of one series, likewise.
  [[nodiscard]] std::vector<std::string> Of(const std::string& series,
                                            const std::vector<Image>& images) const;
  /// How many images cannot be used, and why one of them cannot.
  [[nodiscard]] int num_damaged() const;
  [[nodiscard]] const Message& fault() const { return fault_; }

  [[nodiscard]] nlohmann::ordered_json ToJson() const;
  /// @throws for what ToJson() did not write.
  void FromJson(const nlohmann::ordered_json& json);

 private:
  struct Facts {
    std::string frame_uid, patient_hash;
  };

  std::string key_;
  std::map<std::string, std::string> series_of_;  ///< By name; empty: it cannot be used.
  std::map<std::string, Facts> facts_;            ///< By UID of the series.
  Message fault_;
};

}  // namespace plumb
