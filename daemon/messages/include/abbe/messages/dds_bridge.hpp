#pragma once
/// The logic of abbe-dds, independent of the DDS library. It forwards payloads from abbed (the
/// source) to an outlet, and informs the subscribers when abbed is silent. abbed regularly sends
/// beats to show that it runs.
///
/// - Source alive: abbed sent the last beat within kSilence; the time of sending counts, not the
///   time of reading. Only while the source is alive, samples other than MODEL_INVALID are written
///   and liveliness is asserted.
/// - Source silent, or socket closed: every known ModelState is written once more as MODEL_INVALID
///   with reason SOURCE_LOST. After that nothing is written, so that the liveliness lease of the
///   ModelState writer expires.
/// - Source alive again: durable topics are written again, but ModelState only after abbed has sent
///   it again. A stale ACTIVE is never republished.
/// - Durable topics are repeated with the period TopicTraits::repeat.
/// - The age of a compensation vector is increased by the delay between abbed and this process.
///   Live samples delayed by more than kLongestWait are discarded.
/// - Slices of ErrorGrid with a number beyond those of the newest grid are disposed.
///
/// Used by one thread. The caller passes the time.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "abbe/base/error.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::daemon {

/// The output of the bridge: DDS writers, or a list in a test.
class DdsOutlet {
 public:
  virtual ~DdsOutlet() = default;
  /// Returns false if the writer refused the payload.
  virtual bool write(Topic topic, std::span<const std::byte> payload) = 0;
  /// Disposes the DDS instance that `payload` belongs to, so that late joiners do not receive it.
  virtual void dispose(Topic topic, std::span<const std::byte> payload) = 0;
  virtual void assert_liveliness() = 0;
};

class DdsBridge {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kSilence{500};
  static constexpr std::chrono::milliseconds kAssertPeriod{200};
  /// Live samples that waited longer in the socket are discarded: a machine control could not use
  /// so old a compensation vector.
  static constexpr std::chrono::milliseconds kLongestWait{100};

  /// `outlet` must outlive the bridge.
  explicit DdsBridge(DdsOutlet& outlet);
  ~DdsBridge();
  DdsBridge(const DdsBridge&) = delete;
  DdsBridge& operator=(const DdsBridge&) = delete;

  /// Call it after a new connection to abbed. abbed then sends all durable samples again, so the
  /// retained ones are discarded.
  void connected();
  /// `at`: when abbed sent the beat or the payload. publish() adds the delay since then to the age
  /// in a Compensation payload, in place.
  void beat(WallTime at, WallTime now);
  void publish(Topic topic, std::span<std::byte> payload, WallTime at, WallTime now);
  void lost();  ///< the socket closed, or abbe-dds shuts down
  /// Checks for silence, asserts liveliness, repeats durable topics. Call at least every 50 ms.
  void cycle(WallTime now);

  [[nodiscard]] bool source_alive() const noexcept;
  [[nodiscard]] std::uint64_t written() const noexcept;
  /// number of payloads that the outlet refused or that are malformed
  [[nodiscard]] std::uint64_t refused() const noexcept;
  /// Number of live samples that were discarded because they were delayed by more than
  /// kLongestWait.
  [[nodiscard]] std::uint64_t outdated() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// abbe-dds's end of the local socket: connects to abbed, reconnects after a loss, and passes the
/// frames to the bridge.
class DdsFeed {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kRetryPeriod{50};

  DdsFeed(std::filesystem::path socket, DdsBridge& bridge);
  ~DdsFeed();
  DdsFeed(const DdsFeed&) = delete;
  DdsFeed& operator=(const DdsFeed&) = delete;

  /// Waits at most kRetryPeriod for bytes, passes every complete frame to the bridge, then calls
  /// bridge.cycle().
  void cycle();

  /// Reports to abbed which other publisher claims to be this machine; empty: none. Call it in
  /// every cycle.
  void report_twin(const std::string& seen);

  [[nodiscard]] bool connected() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
