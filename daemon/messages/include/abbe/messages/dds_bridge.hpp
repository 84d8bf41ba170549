#pragma once
/// The rules of abbe-dds, without DDS: what abbed hands over goes to an outlet, and abbed's silence
/// is told to everybody.
/// - alive: a beat sent within kSilence, however late it is read. Only then is anything but INVALID written,
/// and liveliness asserted.
/// - silent, or the socket closed: every ModelState known goes out once more as MODEL_INVALID, reason
/// SOURCE_LOST; then
///   nothing, so that the lease of ModelState's writer ends too.
/// - back: durable topics go out again. The state only once abbed says it anew, so that no old ACTIVE comes
/// to life.
/// - durable topics are repeated as their traits say.
/// - a vector's age counts what it waited on its way here; live samples that waited longer than kLongestWait
/// are discarded.
/// - slices of ErrorGrid beyond those of the newest grid are disposed. Used by one thread; time is handed in.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "abbe/base/error.hpp"
#include "abbe/messages/topics.hpp"

namespace abbe::daemon {

/// Where the bridge writes to: DDS writers, or a list in a test.
class DdsOutlet {
 public:
  virtual ~DdsOutlet() = default;
  virtual bool write(Topic topic, std::span<const std::byte> payload) = 0;  ///< false: refused
  /// The instance this payload was written to is gone: nobody who comes late is to see it.
  virtual void dispose(Topic topic, std::span<const std::byte> payload) = 0;
  virtual void assert_liveliness() = 0;
};

class DdsBridge {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kSilence{500};
  static constexpr std::chrono::milliseconds kAssertPeriod{200};
  static constexpr std::chrono::milliseconds kLongestWait{
      100};  ///< an older vector is of no use to a control

  /// `outlet` must outlive the bridge.
  explicit DdsBridge(DdsOutlet& outlet);
  ~DdsBridge();
  DdsBridge(const DdsBridge&) = delete;
  DdsBridge& operator=(const DdsBridge&) = delete;

  void
  connected();  ///< a new abbed, which will say everything durable again: what the old one said is forgotten
  /// `at`: when abbed said it. The age in the payload of a vector is changed in place.
  void beat(WallTime at, WallTime now);
  void publish(Topic topic, std::span<std::byte> payload, WallTime at, WallTime now);
  void lost();               ///< the socket closed, or abbe-dds is leaving
  void cycle(WallTime now);  ///< silence, liveliness, repetition: call at least every 50 ms

  [[nodiscard]] bool source_alive() const noexcept;
  [[nodiscard]] std::uint64_t written() const noexcept;
  [[nodiscard]] std::uint64_t refused() const noexcept;   ///< by the outlet
  [[nodiscard]] std::uint64_t outdated() const noexcept;  ///< live samples that had waited too long

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// abbe-dds's end of the local socket: connects to abbed, again and again, and feeds the bridge.
class DdsFeed {
 public:
  using WallTime = std::chrono::steady_clock::time_point;
  static constexpr std::chrono::milliseconds kRetryPeriod{50};

  DdsFeed(std::filesystem::path socket, DdsBridge& bridge);
  ~DdsFeed();
  DdsFeed(const DdsFeed&) = delete;
  DdsFeed& operator=(const DdsFeed&) = delete;

  /// One turn: waits at most kRetryPeriod for bytes, feeds every whole frame, then bridge.cycle().
  void cycle();

  [[nodiscard]] bool connected() const noexcept;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
