#pragma once
/// index.sqlite in the folder of a store: the data of each model.json that lists of models show, so
/// that a list need not read all models. The index is a cache. A row is used only while its file
/// has the same inode, time and size and the row has its checksum; a missing or damaged index is
/// rebuilt. A process that may not write to the folder reads the index and does not change it. No
/// call fails: without a usable index there are no rows. An object must be used by one thread only.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <vector>

#include "abbe/model/model_store.hpp"

namespace SQLite {
class Database;
}

namespace abbe::daemon {

/// The data of a model that lists show and that the retention of recordings needs.
struct ModelSummary {
  std::string method{}, machine{};
  std::vector<std::string> inputs{};      ///< names of the files from which the model was made
  std::optional<ModelVerdict> verdict{};  ///< verdict in the file: decision and reasons
  std::optional<bool> simulated{};        ///< made_on_simulated_devices()
  /// reason why the file is not a valid model; all other members are then empty
  std::string fault{};
  bool operator==(const ModelSummary&) const = default;
};

struct IndexedModel {
  std::string id;
  StoreStamp file;  ///< stamp of model.json when it was read
  ModelSummary summary;
};

class ModelIndex {
 public:
  /// Opens FOLDER/index.sqlite, and creates or replaces it if it is missing, damaged or of another
  /// version and the folder is writable.
  explicit ModelIndex(const std::filesystem::path& folder);
  ModelIndex(const ModelIndex&) = delete;
  ModelIndex& operator=(const ModelIndex&) = delete;
  ~ModelIndex();

  /// All rows with a correct checksum, by id; none, and an empty index, if SQLite finds damage.
  [[nodiscard]] std::unordered_map<std::string, IndexedModel> rows();
  /// Adds rows, or replaces rows with the same id. If SQLite finds the index damaged, the index is
  /// emptied.
  void put(std::span<const IndexedModel> models);
  void remove(std::span<const std::string> ids);

 private:
  /// Replaces the index by an empty one; without an index if the folder is not writable.
  void make_again();

  std::filesystem::path file_;
  std::unique_ptr<SQLite::Database> database_;  ///< null: there is no usable index
};

/// Inode, time and size of a file; all zero if there is none.
[[nodiscard]] StoreStamp stamp_of_file(const std::filesystem::path& file) noexcept;

[[nodiscard]] ModelSummary summary_of(const ModelDocument& document);

/// The summaries of the models `ids`, in this order. A summary that the index lacks is read from
/// the model file and added to the index; rows of other models are removed.
[[nodiscard]] std::vector<ModelSummary> summaries(const ModelStore& store,
                                                  const std::filesystem::path& folder,
                                                  const std::vector<std::string>& ids);

}  // namespace abbe::daemon
