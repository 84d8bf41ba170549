// Any bytes as what stands before the chunks of a recording: the whole file, and the packed entries
// of the three metadata records. Records with right checksums pass; with any entry changed they do
// not.
//
// libFuzzer: -max_len=2048

#include <sys/mman.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "abbe/base/file_descriptor.hpp"
#include "abbe/protocol/mcap/records.hpp"
#include "metadata_checksum.hpp"
#include "recorded_bytes.hpp"
#include "recording_contents.hpp"
#include "streams.hpp"

namespace {

using namespace abbe;  // NOLINT(google-build-using-namespace): a program, not a header
namespace mcap = protocol::mcap;
using daemon::recording::MetadataEntries;

void require(bool promise) {
  if (!promise) std::abort();
}

constexpr std::array kNames{daemon::recording::kRecordingMetadata,
                            daemon::recording::kConfigurationMetadata,
                            daemon::recording::kVersionsMetadata};

mcap::Buffer file_of(const std::map<std::string, MetadataEntries>& metadata) {
  mcap::Buffer file;
  mcap::append_magic(file);
  append(file, mcap::Header{"", "abbe"});
  for (const auto& [name, entries] : metadata) {
    mcap::Buffer packed;
    for (const auto& [key, value] : entries) mcap::StringMap::pack(packed, key, value);
    append(file, mcap::Metadata{name, mcap::StringMap{packed}});
  }
  return file;
}

/// Reads `bytes` through a file in memory, as a recording on a disk is read.
daemon::recording::Contents contents_of(mcap::Bytes bytes) {
  const daemon::FileDescriptor memory{::memfd_create("recording", MFD_CLOEXEC)};
  require(memory && ::write(memory.get(), bytes.data(), bytes.size()) ==
                        static_cast<::ssize_t>(bytes.size()));
  const auto file =
      daemon::recording::RecordedBytes::open("/proc/self/fd/" + std::to_string(memory.get()));
  require(file.has_value());
  return daemon::recording::contents_of(**file, {});
}

void check_sealed(std::map<std::string, MetadataEntries> metadata) {
  for (const auto name : kNames) {
    auto& entries = metadata[std::string{name}];
    entries[daemon::recording::kChecksum] = daemon::recording::metadata_sha256(name, entries);
  }
  const auto contents = contents_of(file_of(metadata));
  const auto right = daemon::recording::judge_metadata(contents.metadata);
  require(right.damage.empty() && right.configuration == daemon::MetadataCheck::Right);
  metadata[std::string{kNames[0]}]["entry"] += "more";
  require(!daemon::recording::judge_metadata(metadata).damage.empty());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const mcap::Bytes bytes = std::as_bytes(std::span{data, size});
  if (mcap::Buffer raw(bytes.begin(), bytes.end()); mcap::starts_with_magic(raw)) {
    const auto contents = contents_of(raw);
    (void)daemon::recording::judge_metadata(contents.metadata);
  }
  mcap::Buffer file;
  mcap::append_magic(file);
  for (const auto name : kNames) append(file, mcap::Metadata{name, mcap::StringMap{bytes}});
  const auto contents = contents_of(file);
  (void)daemon::recording::judge_metadata(contents.metadata);
  check_sealed(contents.metadata);
  return 0;
}
