#pragma once
/// Reassembles messages of authentication from their fragments [DDSI-RTPS 2.5, 8.3.8.3]. They come
/// before any key is checked, and a message can only be checked as a whole.
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

/// A DATA_FRAG submessage of a writer of authentication, with lengths that are already checked.
struct Fragment {
  std::array<std::uint8_t, 20> header;  ///< of the RTPS message, with the prefix of the source
  bool little_endian;
  std::span<const std::uint8_t, 16> ids;  ///< reader, writer, sequence number
  std::uint32_t first, count, size;       ///< number of the first one, from 1; size of each
  std::uint32_t sample_size;
  std::span<const std::uint8_t> payload;
};

class FragmentReassembly {
 public:
  /// Fits into one DATA submessage. A certificate and its permissions take 2 to 6 kB.
  static constexpr std::size_t kLongestSample = 60000;
  /// Samples of which fragments are missing. When one more begins, the oldest is discarded.
  static constexpr std::size_t kMostSamples = 64;

  /// If it completes a sample: an RTPS message with the sample in one DATA submessage.
  [[nodiscard]] std::optional<std::vector<std::uint8_t>> add(const Fragment& fragment);

 private:
  struct Sample {
    std::array<std::uint8_t, 12> source;
    std::array<std::uint8_t, 16> ids;
    std::uint32_t fragment_size;
    std::vector<std::uint8_t> message;  ///< with room for the whole sample
    std::vector<bool> received;         ///< by number of the fragment
    std::size_t missing;
  };
  Sample* sample_of(const Fragment& fragment);

  std::mutex mutex_;
  std::deque<Sample> incomplete_;  ///< guarded by mutex_
};

}  // namespace abbe::dds
