#include "model_index.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <SQLiteCpp/VariadicBind.h>
#include <fmt/format.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "abbe/base/json_text.hpp"
#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Increment this number whenever ModelSummary or the table changes: an index with another number
/// is rebuilt.
constexpr int kIndexVersion = 1;
/// Longest wait for another process, which holds the file for milliseconds. If the wait is longer,
/// this process does not use the index.
constexpr int kBusy_ms = 200;

constexpr auto kTable =
    "CREATE TABLE model(id TEXT PRIMARY KEY, inode INTEGER, modified_ns INTEGER, bytes INTEGER, "
    "summary TEXT, sum TEXT) WITHOUT ROWID";

json json_of(const std::optional<ModelVerdict>& verdict) {
  if (!verdict) return {};
  return {{"accepted", verdict->accepted}, {"reasons", verdict->reasons}};
}

std::string text_of(const ModelSummary& summary) {
  return json_text(json{{"method", summary.method},
                        {"machine", summary.machine},
                        {"inputs", summary.inputs},
                        {"verdict", json_of(summary.verdict)},
                        {"simulated", summary.simulated ? json(*summary.simulated) : json()},
                        {"fault", summary.fault}});
}

/// Reads a verdict. Throws json::exception, as summary_from().
std::optional<ModelVerdict> verdict_from(const json& object) {
  if (object.is_null()) return std::nullopt;
  return ModelVerdict{object.at("accepted").get<bool>(),
                      object.at("reasons").get<std::vector<std::string>>()};
}

/// Reads a summary. Throws json::exception if a member is missing or has the wrong type.
ModelSummary summary_from(const std::string& text) {
  const json object = json::parse(text);
  const json& simulated = object.at("simulated");
  return {.method = object.at("method").get<std::string>(),
          .machine = object.at("machine").get<std::string>(),
          .inputs = object.at("inputs").get<std::vector<std::string>>(),
          .verdict = verdict_from(object.at("verdict")),
          .simulated = simulated.is_null() ? std::nullopt : std::optional{simulated.get<bool>()},
          .fault = object.at("fault").get<std::string>()};
}

/// The checksum of a row. SQLite has no checksums, and a changed bit must not change, for example,
/// the name of a machine. The version of abbe is included, because another version may be able to
/// read a file in which this version found a fault.
std::string checksum(const std::string& id, const StoreStamp& file, const std::string& summary) {
  return sha256_hex(fmt::format("{} {} {} {} {} {}", ABBE_VERSION, id, file.inode, file.modified_ns,
                                file.bytes, summary));
}

bool is_damage(const SQLite::Exception& error) {
  return error.getErrorCode() == SQLITE_CORRUPT || error.getErrorCode() == SQLITE_NOTADB;
}

bool is_regular_or_missing(const fs::path& file) {
  std::error_code unknown;
  const auto type = fs::symlink_status(file, unknown).type();
  return type == fs::file_type::regular || type == fs::file_type::not_found;
}

/// Opens the index; null if it cannot be opened or has tables of another version. Throws
/// SQLite::Exception.
std::unique_ptr<SQLite::Database> open_index(const fs::path& file) {
  auto database =
      std::make_unique<SQLite::Database>(file.string(), SQLite::OPEN_READWRITE, kBusy_ms);
  // The index is not synced to the disk: if a power failure damages it, it is rebuilt.
  database->exec("PRAGMA journal_mode = MEMORY; PRAGMA synchronous = OFF");
  const int version = database->execAndGet("PRAGMA user_version").getInt();
  return version == kIndexVersion ? std::move(database) : nullptr;
}

/// Creates a new index. Throws SQLite::Exception.
std::unique_ptr<SQLite::Database> create_index(const fs::path& file) {
  // An empty file is an empty database. replace_file() gives it owner and mode of the store.
  if (!replace_file(file, "")) return nullptr;
  SQLite::Database created{file.string(), SQLite::OPEN_READWRITE, kBusy_ms};
  SQLite::Transaction change{created};
  created.exec(kTable);
  created.exec(fmt::format("PRAGMA user_version = {}", kIndexVersion));
  change.commit();
  return open_index(file);
}

}  // namespace

ModelIndex::ModelIndex(const fs::path& folder) : file_(folder / "index.sqlite") {
  if (!is_regular_or_missing(file_)) return;

  try {
    database_ = open_index(file_);
  } catch (const SQLite::Exception& error) {
    if (error.getErrorCode() == SQLITE_BUSY) return;
  }
  if (database_ == nullptr) make_again();
}

void ModelIndex::make_again() {
  database_ = nullptr;
  if (::access(file_.parent_path().c_str(), W_OK) != 0) return;
  try {
    database_ = create_index(file_);
  } catch (const SQLite::Exception&) {  // the disk is full, or another process creates the index
                                        // now
    database_ = nullptr;
  }
}

ModelIndex::~ModelIndex() = default;

std::unordered_map<std::string, IndexedModel> ModelIndex::rows() {
  std::unordered_map<std::string, IndexedModel> found;
  if (database_ == nullptr) return found;
  bool damaged = false;

  try {
    SQLite::Statement row{*database_,
                          "SELECT id, inode, modified_ns, bytes, summary, sum FROM model"};
    while (row.executeStep()) {
      IndexedModel model{row.getColumn(0).getString(),
                         {static_cast<std::uint64_t>(row.getColumn(1).getInt64()),
                          row.getColumn(2).getInt64(), row.getColumn(3).getInt64()},
                         {}};
      const std::string summary = row.getColumn(4).getString();
      if (checksum(model.id, model.file, summary) != row.getColumn(5).getString()) continue;
      model.summary = summary_from(summary);
      std::string id = model.id;
      found.insert_or_assign(std::move(id), std::move(model));
    }
  } catch (const SQLite::Exception& error) {  // the rows read so far are valid, because their
                                              // checksums were checked
    damaged = is_damage(error);
  } catch (const json::exception&) {  // another version of abbe wrote other members with the same
                                      // kIndexVersion
    found.clear();
  }
  // The index is rebuilt here because the statement, which uses the database, no longer exists. The
  // caller reads the rows from the files again.
  if (damaged) {
    found.clear();
    make_again();
  }
  return found;
}

void ModelIndex::put(std::span<const IndexedModel> models) {
  if (database_ == nullptr || models.empty()) return;
  bool damaged = false;
  try {
    SQLite::Transaction change{*database_};
    SQLite::Statement row{*database_, "INSERT OR REPLACE INTO model VALUES(?, ?, ?, ?, ?, ?)"};
    for (const IndexedModel& model : models) {
      const std::string summary = text_of(model.summary);
      SQLite::bind(row, model.id, static_cast<std::int64_t>(model.file.inode),
                   model.file.modified_ns, model.file.bytes, summary,
                   checksum(model.id, model.file, summary));
      row.exec();
      row.reset();
    }
    change.commit();
  } catch (const SQLite::Exception& error) {  // other errors: read-only, busy or full; the models
                                              // are read again later
    damaged = is_damage(error);
  }
  if (damaged) make_again();
}

void ModelIndex::remove(std::span<const std::string> ids) {
  if (database_ == nullptr || ids.empty()) return;
  try {
    SQLite::Transaction change{*database_};
    SQLite::Statement row{*database_, "DELETE FROM model WHERE id = ?"};
    for (const std::string& id : ids) {
      row.bind(1, id);
      row.exec();
      row.reset();
    }
    change.commit();
  } catch (const SQLite::Exception&) {  // a row that remains without its file is not used
  }
}

ModelSummary summary_of(const ModelDocument& document) {
  ModelSummary summary{.method = document.method,
                       .machine = document.machine,
                       .verdict = document.verdict,
                       .simulated = made_on_simulated_devices(document)};
  for (const InputFile& input : document.inputs) summary.inputs.push_back(input.name);
  return summary;
}

std::vector<ModelSummary> summaries(const ModelStore& store, const fs::path& folder,
                                    const std::vector<std::string>& ids) {
  // Reading a model takes about 10 ms. The rows are written in parts, so that an interrupted
  // rebuild keeps the rows written so far.
  constexpr std::size_t kModelsPerWrite = 64;
  ModelIndex index{folder};
  auto known = index.rows();
  std::vector<ModelSummary> found;
  std::vector<IndexedModel> read;

  for (const std::string& id : ids) {
    const StoreStamp file = stamp_of_file(store.model_path(id));
    const auto row = known.extract(id);
    if (!row.empty() && row.mapped().file == file) {
      found.push_back(std::move(row.mapped().summary));
      continue;
    }
    const auto document = store.load(id);
    found.push_back(document ? summary_of(*document)
                             : ModelSummary{.fault = document.error().text});
    // A file with an Io error is not added to the index, because it may be readable the next time.
    if (document || document.error().code != ErrorCode::Io)
      read.push_back({id, file, found.back()});
    if (read.size() == kModelsPerWrite) index.put(std::exchange(read, {}));
  }

  index.put(read);
  std::vector<std::string> others;
  for (const auto& [id, row] : known) others.push_back(id);
  index.remove(others);
  return found;
}

StoreStamp stamp_of_file(const fs::path& file) noexcept {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return {};
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  return {status.st_ino, status.st_mtim.tv_sec * kSecond_ns + status.st_mtim.tv_nsec,
          status.st_size};
}

}  // namespace abbe::daemon
