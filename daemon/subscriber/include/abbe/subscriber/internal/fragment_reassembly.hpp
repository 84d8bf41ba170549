#pragma once
/// Reassembles messages of authentication from their fragments [DDSI-RTPS 2.5, 8.3.8.3]. These
/// messages arrive before any key is checked, and they can be checked only as a whole.
///
/// Thread-safe: a participant may receive on several channels.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

namespace abbe::dds {

/// A DATA_FRAG submessage from a writer of authentication messages. Its lengths are already
/// checked.
struct Fragment {
  /// header of the RTPS message, with the prefix of the source
  std::array<std::uint8_t, 20> header;
  bool little_endian;
  std::span<const std::uint8_t, 16> ids;  ///< ids of reader and writer, and the sequence number
  /// number of the first fragment, counted from 1; number of fragments; size of each
  std::uint32_t first, count, size;
  std::uint32_t sample_size;
  std::span<const std::uint8_t> payload;
};

class FragmentReassembly {
 public:
  /// Longest sample in bytes; it fits into one DATA submessage. A certificate and its permissions
  /// take 2 to 6 kB.
  static constexpr std::size_t kLongestSample = 60000;
  /// Most incomplete samples. When a further one begins, the oldest is discarded.
  static constexpr std::size_t kMostSamples = 64;

  /// Adds the fragment. If it completes a sample, returns an RTPS message with the sample in one
  /// DATA submessage.
  [[nodiscard]] std::optional<std::vector<std::uint8_t>> add(const Fragment& fragment);

 private:
  struct Sample {
    std::array<std::uint8_t, 12> source;
    std::array<std::uint8_t, 16> ids;
    std::uint32_t fragment_size;
    std::vector<std::uint8_t> message;  ///< has space for the whole sample
    std::vector<bool> received;         ///< one element per fragment
    std::size_t missing;
  };
  Sample* sample_of(const Fragment& fragment);

  std::mutex mutex_;
  std::deque<Sample> incomplete_;  ///< guarded by mutex_
};

}  // namespace abbe::dds
