// SPDX-License-Identifier: Apache-2.0
// What planning systems have sent, and whom the clinic's schedule expects today.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "algo/base/message.hpp"
#include "algo/base/names.hpp"

namespace plumb {

enum class ReceivedKind { kStructures, kPlan, kOther };
template <>
inline constexpr auto kNamesOf<ReceivedKind> = NamesUpTo<ReceivedKind::kOther>({"structures",
                                                                                "plan", "other"});

/// CT images of one series that plumb-dicomd received.
struct ReceivedSeries {
  std::string uid = {};                   ///< As the images state it.
  std::string frame_uid = {};             ///< Of their frame of reference.
  std::string received_at = {};           ///< When the newest of them came.
  std::string sender = {}, address = {};  ///< Who sent the newest of them.
  int images = 0;                         ///< Different ones.
  /// As of ReceivedFile.
  std::string patient_id = {}, patient_code = {};
};

/// A file that plumb-dicomd received. It waits until a physicist imports it, or it is too old.
struct ReceivedFile {
  std::string name = {};  ///< Our own.
  ReceivedKind kind = ReceivedKind::kOther;
  std::string received_at = {};           ///< "2026-03-01T09:30:00Z"
  std::string sender = {}, address = {};  ///< AE title and address of who sent it.
  std::uint64_t bytes = 0;
  std::string label = {};  ///< As the planning system calls it.
  std::string structures =
      {};  ///< Of a plan: the received file that it was made on; empty: not here.
  /// Of a plan: series of images in its frame of reference, newest first.
  std::vector<std::string> series = {};
  /// Of a plan: its structure set is here, and has an external contour with points. Of a structure
  /// set: it has one.
  bool has_skin = false;
  /// The patient whose earlier planning files state the same Patient ID; empty: nobody's do.
  std::string patient_id = {}, patient_code = {};
  std::string reference_id = {};  ///< The draft that was made of it; empty: none.
  bool is_read = true;            ///< False: its turn has not come yet; only the sender is known.
  Message fault = {};             ///< Why it cannot be used; empty: it can.
};

struct Received {
  bool is_on = false;                       ///< Something is to be received.
  std::vector<ReceivedFile> files = {};     ///< Newest first, no images.
  std::vector<ReceivedSeries> series = {};  ///< Newest first.
  int images = 0;                           ///< CT images, read or not.
  int unlisted = 0;                         ///< Older files and images, not looked at.
  int unread = 0;                           ///< Files and images whose turn has not come yet.
  int damaged_images = 0;                   ///< They cannot be used.
  Message image_fault = {};                 ///< Why one of these cannot.
  bool is_settled = true;                   ///< False: this is being read anew; ask again.
  Message fault = {};                       ///< Why nothing could be read; empty: it could.
};

/// Somebody whom the worklist expects today.
struct Appointment {
  std::string time = {};  ///< "09:30", or empty.
  std::string patient_id = {}, patient_code = {};
};

struct TodaysWorklist {
  bool is_on = false;  ///< A worklist is configured.
  std::vector<Appointment> patients = {};
  int unknown = 0;         ///< Appointments of people who are not known here.
  bool is_settled = true;  ///< False: it is being asked; look again.
  Message fault = {};      ///< Why it could not be asked; empty: it could.
};

}  // namespace plumb
