// Whether what is stored is what was stored: the files of scans, and the audit log.
#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "daemon/records/store.hpp"
#include "daemon/records/store_internal.hpp"

namespace plumb {

using store::ParseId;
using store::ScanId;
using store::ToStored;

namespace {

constexpr const char* kScenePrefix = "scene/";
constexpr std::chrono::minutes kUnavailableAgain{10};

std::string Sha256Of(const std::string& text) {
  Sha256 hash;
  hash.Add(text.data(), text.size());
  return hash.Hex();
}

/// One entry of the log as the chain covers it: lengths keep the fields apart.
std::string ChainText(const std::string& before, std::int64_t number, std::int64_t time,
                      const std::array<std::string, 5>& fields) {
  std::string text = fmt::format("{}\n{}\n{}\n", before, number, time);
  for (const std::string& field : fields) text += fmt::format("{}:{}\n", field.size(), field);
  return text;
}

constexpr const char* kAuditRows =
    "SELECT number, time, user, address, action, subject, detail, chain FROM audit ORDER BY number";

std::string ChainOf(const Statement& row, const std::string& before) {
  return Sha256Of(ChainText(before, row.Integer(0), row.Integer(1),
                            {row.Text(2), row.Text(3), row.Text(4), row.Text(5), row.Text(6)}));
}

/// Of everything before the first entry that carries a chain.
std::string ChainOfUnchained(Database& database) {
  std::string chain;
  Statement query = database.Prepare(kAuditRows);
  while (query.Step() && query.Text(7).empty()) chain = ChainOf(query, chain);
  return chain;
}

}  // namespace

/// Within a transaction.
void Store::Write(const web::Actor& actor, const std::string& action, const std::string& subject,
                  const std::string& detail) {
  std::int64_t number = 1;
  {
    Statement query = write_->Prepare("SELECT seq FROM sqlite_sequence WHERE name = 'audit'");
    if (query.Step()) number = query.Integer(0) + 1;
  }
  std::string before;
  {
    Statement query = write_->Prepare("SELECT chain FROM audit ORDER BY number DESC LIMIT 1");
    if (query.Step()) before = query.Text(0);
  }
  if (before.empty()) before = ChainOfUnchained(*write_);
  const std::int64_t time = ToStored(web::WallClock::now());
  write_
      ->Prepare(
          "INSERT INTO audit (number, time, user, address, action, subject, detail, chain) VALUES "
          "(?, ?, ?, ?, ?, ?, ?, ?)")
      .Bind(number)
      .Bind(time)
      .Bind(actor.user)
      .Bind(actor.address)
      .Bind(action)
      .Bind(subject)
      .Bind(detail)
      .Bind(Sha256Of(
          ChainText(before, number, time, {actor.user, actor.address, action, subject, detail})))
      .Run();
}

std::optional<std::int64_t> Store::FirstBrokenAuditEntry() {
  const std::lock_guard lock(list_mutex_);
  std::string chain;
  std::int64_t last = 0;
  bool has_begun = false;
  {
    Statement query = list_->Prepare(kAuditRows);
    while (query.Step()) {
      chain = ChainOf(query, chain);
      has_begun = has_begun || !query.Text(7).empty();
      if (query.Integer(0) != last + 1 || (has_begun && query.Text(7) != chain)) return last + 1;
      last = query.Integer(0);
    }
  }
  Statement query = list_->Prepare("SELECT seq FROM sqlite_sequence WHERE name = 'audit'");
  const std::int64_t given = query.Step() ? query.Integer(0) : 0;
  return given == last ? std::nullopt : std::optional(last + 1);  // entries at the end are gone
}

std::vector<FileDigest> Store::StoredDigests(std::int64_t scan) {
  Statement query =
      write_->Prepare("SELECT path, bytes, sha256 FROM scan_files WHERE scan_id = ? ORDER BY path");
  query.Bind(scan);
  std::vector<FileDigest> files;
  while (query.Step()) {
    files.push_back({.path = query.Text(0),
                     .bytes = static_cast<std::uint64_t>(query.Integer(1)),
                     .sha256 = query.Text(2)});
  }
  return files;
}

/// Within a transaction. What has a digest keeps it.
void Store::StoreDigests(std::int64_t scan, const std::vector<FileDigest>& files) {
  for (const FileDigest& file : files) {
    write_
        ->Prepare(
            "INSERT OR IGNORE INTO scan_files (scan_id, path, bytes, sha256) VALUES (?, ?, ?, ?)")
        .Bind(scan)
        .Bind(file.path)
        .Bind(static_cast<std::int64_t>(file.bytes))
        .Bind(file.sha256)
        .Run();
  }
}

/// Within a transaction.
void Store::SetUnavailable(std::int64_t scan, const std::string& before, const std::string& now) {
  if (before == now) return;
  write_->Prepare("UPDATE scans SET unavailable = ? WHERE id = ?").Bind(now).Bind(scan).Run();
  if (before.empty()) {
    Write(store::kSelf, "scan.unavailable", ScanId(scan), now + "; nothing was deleted");
  } else if (now.empty()) {
    Write(store::kSelf, "scan.available", ScanId(scan), "its files are there again");
  }
}

std::string Store::CheckFiles(const std::string& scan_id, bool scene_only,
                              const std::stop_token& stop) {
  const std::int64_t scan = ParseId(scan_id).value_or(0);
  std::vector<FileDigest> files;
  bool is_done = false;
  {
    const std::lock_guard lock(write_mutex_);
    Statement query = write_->Prepare("SELECT outcome FROM scans WHERE id = ? AND has_folder = 1");
    if (!query.Bind(scan).Step()) return "it has no files";
    is_done = query.Text(0) == "done";
    files = StoredDigests(scan);
  }
  const auto has = [&](const char* path) {
    return std::any_of(files.begin(), files.end(),
                       [&](const FileDigest& file) { return file.path == path; });
  };
  const std::filesystem::path folder = ScanFolder(scan_id);
  std::vector<FileDigest> first_seen;
  std::string fault;
  if (is_done && !has(kSceneMarker)) {  // stored by an older Plumb
    fault = WhyNotThere(folder, {{.path = kSceneMarker, .sha256 = {}}}, options_.look);
    if (fault.empty()) first_seen = DigestsOfScan(folder, stop);
  } else {
    fault = WhyNotIntact(folder, files, scene_only ? kScenePrefix : "", stop);
  }
  if (!scene_only && fault.empty() && !has(kRecordingFolder)) {
    if (auto recording = DigestOfRecording(folder, stop)) first_seen.push_back(*recording);
  }
  const std::lock_guard lock(write_mutex_);
  Transaction transaction(*write_);
  std::string before;
  {
    Statement query = write_->Prepare("SELECT unavailable FROM scans WHERE id = ?");
    if (!query.Bind(scan).Step()) return "it was removed meanwhile";
    before = query.Text(0);
  }
  StoreDigests(scan, first_seen);
  // A scene that is whole says nothing of the other files.
  if (!scene_only || !fault.empty()) SetUnavailable(scan, before, fault);
  if (!scene_only) {
    write_->Prepare("UPDATE scans SET checked_at = ? WHERE id = ?")
        .Bind(ToStored(web::WallClock::now()))
        .Bind(scan)
        .Run();
  }
  transaction.Commit();
  return fault;
}

std::optional<Store::CheckedScan> Store::CheckNextScan(std::chrono::hours at_least,
                                                       const std::stop_token& stop) {
  std::string id;
  {
    const std::lock_guard lock(write_mutex_);
    const web::WallClock::time_point now = web::WallClock::now();
    // A stamp of the future says nothing, and what was out of sight may be back.
    Statement query = write_->Prepare(
        "SELECT id FROM scans WHERE has_folder = 1 AND (checked_at <= ?1 OR checked_at > ?2 OR "
        "(unavailable <> '' AND checked_at <= ?3)) ORDER BY checked_at, id LIMIT 1");
    query.Bind(ToStored(now - at_least))
        .Bind(ToStored(now))
        .Bind(ToStored(now - kUnavailableAgain));
    if (!query.Step()) return std::nullopt;
    id = ScanId(query.Integer(0));
  }
  std::string fault = CheckFiles(id, /*scene_only=*/false, stop);
  return CheckedScan{.id = std::move(id), .fault = std::move(fault)};
}

}  // namespace plumb
