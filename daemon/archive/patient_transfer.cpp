// SPDX-License-Identifier: Apache-2.0
#include "daemon/archive/patient_transfer.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "algo/base/ascii_lower.hpp"
#include "algo/base/bounded_json.hpp"
#include "algo/base/check_stop.hpp"
#include "algo/base/errors.hpp"
#include "algo/base/utf8.hpp"
#include "daemon/archive/patient_record.hpp"
#include "daemon/archive/summed_folder.hpp"
#include "daemon/database/audit_store.hpp"
#include "daemon/database/scan_folders.hpp"
#include "daemon/database/schema.hpp"
#include "daemon/database/stored_values.hpp"
#include "daemon/imports/imported_room.hpp"
#include "daemon/records/store.hpp"
#include "daemon/scan_files/file_copy.hpp"
#include "drivers/files/file_io.hpp"
#include "drivers/files/temporary.hpp"
#include "web/model/limits.hpp"
#include "words/backup.hpp"
#include "words/output.hpp"

namespace plumb {

namespace fs = std::filesystem;

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kAboutExport = "patient.json";
constexpr const char* kRecord = "record.json";
constexpr const char* kImports = "imports";
constexpr const char* kImporting = ".import";
constexpr std::size_t kMaxRecord = std::size_t{256} << 20;

/// Converts "scans/000004/..." to 4.
std::optional<std::int64_t> ScanOf(const std::string& path) {
  const fs::path parts(path);
  auto part = parts.begin();
  if (*part++ != kScansFolder || part == parts.end()) return std::nullopt;
  const std::optional<std::int64_t> scan = ParseId(part->string());
  const bool is_ours = scan && ScanId(*scan) == part->string() && ++part != parts.end();
  return is_ours ? scan : std::nullopt;
}

bool ExportMayHold(const std::string& path) { return path == kRecord || ScanOf(path).has_value(); }

const SummedKind kExportKind{
    .name = "export", .about_file = kAboutExport, .format = 1, .may_hold = ExportMayHold};

/// Opens the source of an export; a backup is not changed.
std::unique_ptr<Database> OpenSource(const fs::path& state, bool is_backup) {
  std::error_code error;
  if (!fs::is_regular_file(state / kDatabaseFile, error))
    throw IoError(say::backup::ExportNoStore(state.string()));
  auto database = std::make_unique<Database>(
      state / kDatabaseFile, is_backup ? Database::Access::kFrozen : Database::Access::kReadWrite);
  if (!is_backup) {
    Migrate(*database);
    return database;
  }
  if (database->FirstInteger("PRAGMA user_version") != kSchemaVersion)
    throw DataError(say::backup::ExportOtherVersion(state.string()));
  return database;
}

struct PatientCode {
  std::int64_t id = 0;
  std::string code;
};

/// The patient whose code it is but for hyphens and capitals; of several, which units before 0.3.0
/// took, the one who has exactly this code, or all of them if none has.
std::vector<PatientCode> PatientsOf(Database& database, const std::string& code) {
  std::vector<PatientCode> rows = database.All(
      "SELECT id, code FROM patients WHERE replace(code, '-', '') = replace(?, '-', '') COLLATE "
      "NOCASE AND id > 0 ORDER BY id",
      [](const Statement& row) {
        return PatientCode{row.Integer(0), row.Text(1)};
      },
      code);
  const auto exact = std::ranges::find_if(
      rows, [&](const PatientCode& row) { return AsciiLower(row.code) == AsciiLower(code); });
  return exact == rows.end() ? rows : std::vector{*exact};
}

/// The record of an earlier import; null if the patient was created here.
Json EarlierEvidence(const fs::path& state, std::int64_t patient) {
  std::error_code error;
  const fs::path file = ImportedFile(state, patient);
  if (!fs::exists(file, error)) return nullptr;
  Json earlier = ParseBoundedJsonOrNothing<Json>(ReadTextFile(file, kMaxRecord));
  if (earlier.is_discarded()) throw DataError(say::backup::ImportRecordDamaged(file.string()));
  return earlier;
}

/// In which room each reference was scanned, by the number of its scan: here, or where an earlier
/// import says.
Json RoomsOf(Database& database, const Json& rows, const Json& earlier) {
  const Json known = earlier.is_object() ? earlier.value("rooms_here", Json()) : Json();
  const Json own = OwnRoomJson(database);
  Json rooms = Json::object();
  for (const Json& reference : rows["refs"]) {
    const std::string scan = std::to_string(reference["scan_id"].get<std::int64_t>());
    rooms[scan] = known.is_object() && known.contains(scan) ? known[scan] : own;
  }
  return rooms;
}

}  // namespace

PatientReport ExportPatient(const fs::path& state, const std::string& code, const fs::path& place,
                            const std::stop_token& stop, const AgeRecipients& recipients) {
  const fs::path target = EncryptedName(place, recipients);
  std::error_code ignored;
  const bool is_backup = fs::exists(state / "backup.json", ignored);
  const std::unique_ptr<Database> database = OpenSource(state, is_backup);
  const std::vector<PatientCode> owners = PatientsOf(*database, code);
  if (owners.empty())
    throw DataError(say::backup::ExportNoPatient(code.substr(0, kMaxName), state.string()));
  if (owners.size() > 1)
    throw DataError(say::backup::ExportSeveralPatients(code.substr(0, kMaxName), owners[0].code,
                                                       owners[1].code));
  const std::int64_t patient = owners.front().id;
  const Json rows = PatientRows(*database, patient);
  const TemporaryFolder own(fs::temp_directory_path(), "plumb-");
  const Json earlier = EarlierEvidence(state, patient);
  WriteWholeFile(own.path() / kRecord, Json{{"rows", rows},
                                            {"evidence", PatientEvidence(*database, patient)},
                                            {"rooms", RoomsOf(*database, rows, earlier)},
                                            {"earlier", earlier}}
                                           .dump(1, ' ', false, Json::error_handler_t::replace));
  SummedWriter output(target, kExportKind,
                      {say::output::PatientExport(),
                       kAboutExport,
                       {kAboutExport, kSumsFile, kRecord, kScansFolder}},
                      recipients, stop);
  output.AddOwn(own.path(), kRecord);
  std::map<std::string, std::string> found;
  for (const Json& scan : rows["scans"]) {
    if (scan["has_folder"] == 0) continue;
    for (const std::string& file : FilesBelow(state, state / kScansFolder / ScanId(scan["id"])))
      found[file] = output.Add(state, file);
  }
  for (const Json& file : rows["scan_files"]) {
    const std::string path = fmt::format("{}/{}/{}", kScansFolder, ScanId(file["scan_id"]),
                                         file["path"].get<std::string>());
    if (file["path"] == kRecordingFolder) continue;  // checked separately
    if (const auto copy = found.find(path); copy == found.end() || copy->second != file["sha256"])
      output.Report(copy == found.end() ? say::backup::FileMissing(path)
                                        : say::backup::FileChanged(path));
  }
  output.Commit({{"scans", rows["scans"].size()}, {"references", rows["refs"].size()}});
  PatientReport report{.code = rows["patients"][0]["code"],
                       .scans = rows["scans"].size(),
                       .references = rows["refs"].size(),
                       .files = output.files(),
                       .bytes = output.bytes(),
                       .problems = output.problems()};
  if (is_backup) return report;
  Message described = say::backup::LogExported(report.code, ValidUtf8(target.string()),
                                               static_cast<std::int64_t>(report.scans),
                                               static_cast<std::int64_t>(report.references),
                                               static_cast<std::int64_t>(report.problems.size()));
  if (!recipients.empty()) described = say::backup::LogEncrypted(std::move(described));
  Transaction transaction(*database);
  AppendAuditEntry(*database, kCommand, "patient.export", std::to_string(patient), described);
  transaction.Commit();
  return report;
}

/// One export that is being imported into a store.
class PatientImport {
 public:
  PatientImport(const fs::path& folder, const fs::path& state, const BackupKeys& keys,
                std::stop_token stop)
      : reader_(folder, kExportKind, keys, state, stop),
        store_(state),
        database_(store_.database().ForChanges()),
        stop_(std::move(stop)) {}
  ~PatientImport() {
    std::error_code ignored;
    fs::remove_all(Made(), ignored);
  }
  PatientImport(const PatientImport&) = delete;
  PatientImport& operator=(const PatientImport&) = delete;

  PatientReport Import() {
    if (reader_.files().empty() || reader_.files().front().path != kRecord)
      reader_.Fail(say::backup::WithoutFile(kRecord));
    reader_.Verify(stop_);
    fs::remove_all(Made());  // left by an interrupted import
    fs::create_directory(Made());
    ::chmod(Made().c_str(), 0700);
    ReadRecord();
    if (IsThere()) {
      report_.was_there = true;
      return report_;
    }
    CopyFiles();
    Insert();
    return report_;
  }

 private:
  [[nodiscard]] fs::path Made() const { return store_.folders.state() / kImporting; }

  void ReadRecord() {
    (void)reader_.CopyTo(Made(), reader_.files().front(), stop_);
    record_ = ParseBoundedJsonOrNothing<Json>(ReadTextFile(Made() / kRecord, kMaxRecord));
    try {
      if (!record_.is_object()) throw DataError(say::backup::ImportRecordUnreadable(kRecord));
      CheckPatientRows(*database_, record_.value("rows", Json()));
    } catch (const DataError& error) {
      reader_.Fail(error.message());
    }
    const Json& patient = rows().at("patients")[0];
    report_.code = patient.value("code", "");
    const bool is_code = !report_.code.empty() && report_.code.size() <= kMaxName &&
                         report_.code.find_first_not_of(
                             "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                             "abcdefghijklmnopqrstuvwxyz"
                             "0123456789.-_") == std::string::npos;
    if (!is_code) reader_.Fail(say::backup::ImportCode());
    report_.scans = rows().at("scans").size();
    report_.references = rows().at("refs").size();
  }

  [[nodiscard]] const Json& rows() const { return record_.at("rows"); }

  /// @throws InvalidRequest if another patient has the code, or this patient has other data.
  bool IsThere() {
    const std::vector<PatientCode> found = PatientsOf(*database_, report_.code);
    if (found.empty()) return false;
    if (found.size() == 1) {
      const std::int64_t patient = found.front().id;
      if (PatientRows(*database_, patient) == rows()) return true;  // the store of the export
      const Json earlier = EarlierEvidence(store_.folders.state(), patient);
      if (earlier.is_object() && earlier.value("rows", Json()) == rows()) return true;
    }
    throw InvalidRequest(say::backup::ImportOtherPatient(report_.code));
  }

  void CopyFiles() {
    std::map<std::int64_t, bool> keeps_files;
    for (const Json& scan : rows().at("scans"))
      keeps_files[scan.at("id")] = scan.value("has_folder", 0) != 0;
    for (const FileDigest& file : reader_.files()) {
      CheckStop(stop_);
      const std::optional<std::int64_t> scan = ScanOf(file.path);
      if (scan && !keeps_files[*scan]) reader_.Fail(say::backup::ImportFileOfNoScan(file.path));
      report_.bytes += scan ? reader_.CopyTo(Made(), file, stop_).bytes : 0;
      ++report_.files;
    }
    SyncWholeDisk(store_.folders.state());
  }

  void Insert() {
    std::vector<fs::path> moved;
    try {
      Transaction transaction(*database_);
      InsertRows();
      const std::int64_t patient = new_ids_["patients"].begin()->second;
      for (const auto& [before, now] : new_ids_["scans"]) {
        const fs::path from = Made() / kScansFolder / ScanId(before),
                       to = store_.folders.Scan(ScanId(now));
        if (!fs::exists(from)) continue;
        if (::rename(from.c_str(), to.c_str()) != 0) throw IoError(DescribeWriteError(to, errno));
        moved.push_back(to);
      }
      fs::create_directories(store_.folders.state() / kImports);
      moved.push_back(ImportedFile(store_.folders.state(), patient));
      NoteRooms();
      WriteWholeFile(moved.back(), record_.dump(1, ' ', false, Json::error_handler_t::replace));
      GiveToOwnerOf(store_.folders.state(), store_.folders.state() / kImports);
      for (const fs::path& path : moved) GiveToOwnerOf(store_.folders.state(), path);
      SyncWholeDisk(store_.folders.state());
      AppendAuditEntry(*database_, kCommand, "patient.import", std::to_string(patient),
                       say::backup::LogImported(
                           report_.code, static_cast<std::int64_t>(report_.scans),
                           static_cast<std::int64_t>(report_.references), reader_.digest()));
      transaction.Commit();
    } catch (const ConstraintBroken& error) {
      Remove(moved);
      reader_.Fail(say::backup::ImportBreaksRule(error.message()));
    } catch (const fs::filesystem_error& error) {
      Remove(moved);
      throw IoError(DescribeWriteError(store_.folders.state(), error.code().value()));
    } catch (...) {
      Remove(moved);
      throw;
    }
  }

  /// The rooms of the references by their new numbers; null where the export knows none.
  void NoteRooms() {
    const Json rooms = record_.value("rooms", Json());
    Json here = Json::object();
    for (const Json& reference : rows().at("refs")) {
      const std::int64_t scan = reference.at("scan_id");
      const auto found = rooms.find(std::to_string(scan));
      here[std::to_string(new_ids_["scans"].at(scan))] =
          rooms.is_object() && found != rooms.end() ? *found : Json();
    }
    record_["rooms_here"] = std::move(here);
  }

  static void Remove(const std::vector<fs::path>& moved) {
    std::error_code ignored;
    for (const fs::path& path : moved) fs::remove_all(path, ignored);
  }

  void InsertRows() {
    for (const char* table : kPatientTables) {
      const std::vector<ColumnOf> columns = ColumnsOf(*database_, table);
      for (const Json& row : rows().at(table)) InsertRow(table, columns, row);
    }
    // A scan, its session and the reference of its comparison refer to each other.
    for (const std::string table : {"sessions", "scans"}) {
      for (const Json& row : rows().at(table)) {
        if (!row.contains("reference_id") || row["reference_id"].is_null()) continue;
        database_->Run(fmt::format("UPDATE {} SET reference_id = ? WHERE id = ?", table),
                       new_ids_["refs"].at(row["reference_id"]), new_ids_[table].at(row["id"]));
      }
    }
  }

  void InsertRow(const std::string& table, const std::vector<ColumnOf>& columns, const Json& row) {
    std::string names, marks;
    std::vector<Json> values;
    for (const ColumnOf& column : columns) {
      if (column.name == "id" || !row.contains(column.name)) continue;
      names += (names.empty() ? "" : ", ") + column.name;
      marks += marks.empty() ? "?" : ", ?";
      values.push_back(ValueHere(table, column.name, row));
    }
    Statement insert =
        database_->Prepare(fmt::format("INSERT INTO {} ({}) VALUES ({})", table, names, marks));
    for (const Json& value : values) {
      if (value.is_null()) {
        insert.BindNull();
      } else if (value.is_string()) {
        insert.Bind(std::string_view(value.get_ref<const std::string&>()));
      } else if (value.is_number_integer()) {
        insert.Bind(value.get<std::int64_t>());
      } else {
        insert.Bind(value.get<double>());
      }
    }
    insert.Run();
    if (row.contains("id")) new_ids_[table][row["id"]] = database_->last_id();
  }

  /// A value converted for this store: with its own numbers, and without decisions made elsewhere.
  Json ValueHere(const std::string& table, const std::string& column, const Json& row) {
    const Json& value = row[column];
    if (column == "patient_id") return new_ids_["patients"].at(value);
    if (column == "scan_id") return new_ids_["scans"].at(value);
    if (column == "session_id" && !value.is_null()) return new_ids_["sessions"].at(value);
    if (column == "reference_id") return nullptr;  // set once the references exist
    if (table == "refs" && column == "approved_by") return "";
    if (table == "refs" && column == "approved_digest") return "";
    if (table == "refs" && column == "approved_at") return nullptr;
    if (table == "patients" && column == "wiping") return 0;
    if (table == "sessions" && column == "closed_at" && value.is_null()) return row["opened_at"];
    return value;
  }

  SummedReader reader_;
  Store store_;
  StoreDatabase::Held database_;  ///< Held for the whole import.
  std::stop_token stop_;
  Json record_;
  PatientReport report_;
  std::map<std::string, std::map<std::int64_t, std::int64_t>> new_ids_;  ///< For each table.
};

PatientReport ImportPatient(const fs::path& folder, const fs::path& state,
                            const std::stop_token& stop, const BackupKeys& keys) {
  std::error_code error;
  if (!fs::is_regular_file(state / kDatabaseFile, error))
    throw IoError(say::backup::ImportNoStore(state.string()));
  return PatientImport(folder, state, keys, stop).Import();
}

}  // namespace plumb
