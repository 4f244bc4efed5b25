// SPDX-License-Identifier: Apache-2.0
// What plumb-dicomd received, and what became of it.
#pragma once

#include <chrono>
#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "daemon/received/received_images.hpp"
#include "web/model/planning.hpp"

namespace plumb {

/// Reads the folder of plumb-dicomd, which is another account's: nothing there is changed. What was
/// read of a file is kept in a file of our own, so that each is read once. Thread-safe.
class ReceivedFiles {
 public:
  /// @param spool  Of plumb-dicomd.
  /// @param notes  Our own file. Damaged notes are discarded, and every file is read again.
  /// @param key  For PatientHash(); of the Patient ID only that is kept.
  /// @param reading_images  For how long each call reads images, at least one.
  ReceivedFiles(std::filesystem::path spool, std::filesystem::path notes, std::string key,
                std::chrono::milliseconds reading_images = std::chrono::seconds(2));

  struct Entry {
    ReceivedFile file;
    std::string patient_hash;  ///< Empty: the file states no Patient ID.
  };
  struct Listing {
    std::vector<Entry> entries;                  ///< Newest first.
    std::vector<ReceivedImages::Series> series;  ///< Likewise.
    int images = 0;
    int unlisted = 0;  ///< Older files and images, which are not looked at.
    int unread = 0;    ///< Files and images: another call reads more of them.
    int damaged_images = 0;
    Message image_fault;  ///< Why one of those cannot be used.
  };
  /// Files are read by plumb-dicom-reader, a few at each call, and images for a while.
  /// @throws IoError if the folder or the notes cannot be read or written.
  [[nodiscard]] Listing List();

  /// @throws DataError if there is no such file.
  [[nodiscard]] std::filesystem::path PathOf(const std::string& name) const;

  /// A series whose newest image is younger than this may still be arriving. This is an
  /// assumption: how long senders of clinics pause was not measured.
  static constexpr std::chrono::seconds kSeriesPause{60};
  struct SeriesFiles {
    std::vector<std::filesystem::path> files;
    /// Why these may not be all: the series may still be arriving, an image that came before the
    /// end of kSeriesPause is not read yet, or there are more images than are looked at. Empty:
    /// they are.
    Message why_not;
  };
  /// The images of a series.
  /// @throws DataError if there are none; IoError as above.
  [[nodiscard]] SeriesFiles ImagesOf(const std::string& series);

  /// A draft was made of them. @throws IoError
  void NoteReference(const std::vector<std::string>& names, const std::string& reference_id);

 private:
  /// What is known of a file once it was read.
  struct Known {
    ReceivedKind kind = ReceivedKind::kOther;
    std::string instance_uid = {}, structure_set_uid = {}, label = {}, patient_hash = {},
                reference_id = {};
    std::string frame_uid = {};  ///< Of a plan.
    bool has_skin = false;       ///< Of a structure set: an external contour with points.
    bool is_stale = false;       ///< An earlier version read it, and knew less of it.
    Message fault = {};
  };
  /// What is in the folder.
  struct Found {
    std::vector<ReceivedFile> files;
    std::vector<ReceivedImages::Image> images;
    int num_images = 0, unlisted = 0;
  };

  void Load();
  void Store() const;
  [[nodiscard]] Found Look() const;
  /// Reads what has not been read yet, for a while, and keeps it.
  void ReadSome(const Found& found);
  [[nodiscard]] bool IsRead(const std::string& name) const;
  /// @param files  Of a series, newest first. @param images  All that were found.
  [[nodiscard]] Message WhyNotWhole(const std::vector<std::filesystem::path>& files,
                                    const std::vector<ReceivedImages::Image>& images) const;
  /// Names the structure set and the series of each plan.
  void JoinPlans(Listing& listing) const;
  [[nodiscard]] Known ReadOne(const std::string& name) const;

  const std::filesystem::path spool_, notes_;
  const std::string key_;
  const std::chrono::milliseconds reading_images_;
  std::mutex mutex_;
  bool is_loaded_ = false;
  std::map<std::string, Known> known_;  ///< By name.
  ReceivedImages images_;
};

}  // namespace plumb
