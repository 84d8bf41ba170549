#pragma once
/// Checksums of the metadata that a replay and an identification read: MCAP has none for metadata
/// records. Each of the three records of abbe carries one over its name and all its other entries;
/// a recording of before has none at all (but one of the configuration's text).

#include <map>
#include <string>
#include <string_view>

#include "abbe/recording/recording_reader.hpp"

namespace abbe::daemon::recording {

using MetadataEntries = std::map<std::string, std::string>;

/// Entry of each record: metadata_sha256() of the others.
inline constexpr const char* kChecksum = "entries_sha256";

/// SHA-256 in hex over the record's name and its entries in order of their names, each text behind
/// its length as eight bytes, little-endian. kChecksum itself does not count.
[[nodiscard]] std::string metadata_sha256(std::string_view record, const MetadataEntries& entries);

struct MetadataJudgement {
  MetadataCheck configuration = MetadataCheck::Unchecked;
  std::string
      /// of the other records: "metadata abbe.versions: its checksum is wrong"; empty: none
      damage;
};
[[nodiscard]] MetadataJudgement judge_metadata(
    const std::map<std::string, MetadataEntries>& metadata);

}  // namespace abbe::daemon::recording
