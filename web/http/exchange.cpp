// SPDX-License-Identifier: Apache-2.0
#include "web/http/exchange.hpp"

#include <microhttpd.h>

#include <chrono>
#include <memory>
#include <utility>

#include "algo/base/errors.hpp"
#include "words/web.hpp"

namespace plumb::web {
namespace {

/// Size of the pieces in which an uploaded file is written; one is written while the next arrives.
constexpr std::size_t kUploadBlock = 1 << 20;
/// Until a download asks again for a place in a full queue.
constexpr std::chrono::milliseconds kTryAgain{100};

}  // namespace

void Exchange::Suspend() {
  suspended = true;
  MHD_suspend_connection(connection);
}

void Exchange::Resume() {
  if (!suspended) return;
  suspended = false;
  try_again_at.reset();
  MHD_resume_connection(connection);
  wake();
}

void Exchange::Answer(Response given) {
  if (response) return;
  response = std::move(given);
  Resume();
}

bool Exchange::TakeBody(std::string_view bytes) {
  if (response) return true;  // refused in the middle of a file: the rest is read and dropped
  if (!request.upload) {
    if (request.body.size() + bytes.size() > options.max_body_bytes) return false;
    request.body.append(bytes);
    return true;
  }
  uploaded += bytes.size();
  if (uploaded > options.max_upload_bytes) return false;
  unwritten.append(bytes);
  if (unwritten.size() >= kUploadBlock) WriteUpload();
  return true;
}

/// Passes the buffered data to the disk, or makes the connection wait for the previous piece.
void Exchange::WriteUpload() {
  if (writing) return Suspend();
  const auto failure = std::make_shared<Message>();
  const auto work = [file = request.upload, bytes = std::exchange(unwritten, {}), failure] {
    try {
      file->Append(bytes);
    } catch (const IoError& error) {
      *failure = error.message();
    }
  };
  writing = true;
  const bool accepted =
      background.RunInBackground(BackgroundPool::kFiles, work, [weak = weak_from_this(), failure] {
        if (const auto alive = weak.lock()) alive->HaveWritten(*failure);
      });
  if (!accepted) HaveWritten(say::web::DiskTooBusy());
}

void Exchange::HaveWritten(const Message& failure) {
  writing = false;
  if (!failure.empty() && !response) {
    request.upload.reset();
    unwritten = {};
    started = true;
    response = ErrorResponse(507, failure);
  }
  Resume();
}

bool Exchange::HasWholeUpload() {
  if (!request.upload) return true;
  if (!writing && !unwritten.empty()) WriteUpload();
  if (!writing) return true;
  Suspend();
  return false;
}

std::optional<std::size_t> Exchange::NextPiece(std::uint64_t at, std::span<char> into) {
  if (fetch_failed) return std::nullopt;
  if (!fetched.empty()) {
    const std::size_t count = fetched.copy(into.data(), into.size());
    fetched.erase(0, count);
    return count;
  }
  try {
    if (const auto count = response->file->ReadAtOnce(at, into)) return count;
  } catch (const IoError&) {
    return std::nullopt;
  }
  Fetch(at, into.size());
  return 0;
}

void Exchange::Fetch(std::uint64_t at, std::size_t most) {
  const auto bytes = std::make_shared<std::string>();
  const auto work = [file = response->file, bytes, at, most] {
    try {
      *bytes = file->Read(at, most);
    } catch (const IoError&) {
      bytes->clear();
    }
  };
  Suspend();
  const auto done = [weak = weak_from_this(), bytes] {
    const auto alive = weak.lock();
    if (!alive) return;
    alive->fetched = std::move(*bytes);
    alive->fetch_failed = alive->fetched.empty();
    alive->Resume();
  };
  if (background.RunInBackground(BackgroundPool::kReads, work, done)) return;
  try_again_at = std::chrono::steady_clock::now() + kTryAgain;
}

}  // namespace plumb::web
