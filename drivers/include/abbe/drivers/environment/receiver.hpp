#pragma once
/// Selects the requests to a Modbus device and decodes its answers. Sans-I/O and deterministic: the
/// same bytes with the same times give the same samples, live or replayed. On a new connection the
/// proving registers (register_map.hpp) are read first. Then each round of reads gives one sample.
/// Real time: allocation-free, no system call. One thread.
///
/// The time of a sample is the middle between the first request and the last answer of its round;
/// the uncertainty is rectangular over that interval ([GUM] 4.3.7). The age of a value inside the
/// device is not known and not included.
///
/// Raw blocks: a block ToDevice is one complete request; an empty one records a lost connection. A
/// block FromDevice holds bytes as read; an empty one records a new connection.

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/environment/register_map.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

/// The reason why the answers of the device are rejected; text_of() makes a text with the names of
/// the register map.
struct EnvironmentFailure {
  enum class Kind : std::uint8_t {
    None,
    Unasked,      ///< bytes without an outstanding request
    Malformed,    ///< the answer is not valid for the request: `error`
    Exception,    ///< the device answered with the Modbus exception code `exception`
    Unproven,     ///< proving register `index` contains `value`: wrong device or wrong map
    Implausible,  ///< measured register `index` reads `value` in the first round: wrong map
  };
  Kind kind = Kind::None;
  modbus::DecodeError error{};
  std::uint8_t exception = 0;
  std::size_t index = 0;
  double value = 0.0;  ///< Unproven: the register; Implausible: SI
  modbus::ReadRequest request{};
};
/// True if a retry cannot succeed: the device or the map must be changed.
[[nodiscard]] bool is_refusal(const EnvironmentFailure& failure) noexcept;
[[nodiscard]] std::string text_of(const EnvironmentFailure& failure, const RegisterMap& map);

struct EnvironmentCounters {
  std::uint64_t samples = 0;
  std::uint64_t unavailable = 0;  ///< values that the device marked as not available
  std::uint64_t implausible = 0;  ///< values outside plausible_range(), treated as not available
};

class EnvironmentReceiver {
 public:
  enum class Progress : std::uint8_t {
    Waiting,   ///< the answer is incomplete, or no request is outstanding
    Answered,  ///< the answer is complete; the next request may be sent
    Sample,    ///< sample() is new; the next round may begin when it is due
    Failed,    ///< see failure(); no further request or sample until begin()
  };

  /// Precondition: the map has passed check(). Allocates.
  EnvironmentReceiver(RegisterMap map, modbus::Transport transport);

  /// Call for each new connection, and to restart on an existing one: begins with the proving
  /// registers.
  void begin() ABBE_RT;
  /// The request to send now; nullopt while an answer is outstanding or after a failure.
  [[nodiscard]] std::optional<modbus::ReadRequest> next_request() const ABBE_RT;
  /// True if the next request begins a new round of measuring.
  [[nodiscard]] bool between_rounds() const ABBE_RT { return proven_ && read_ == 0 && !pending_; }
  [[nodiscard]] bool proven() const ABBE_RT { return proven_; }
  [[nodiscard]] bool awaiting() const ABBE_RT { return pending_.has_value(); }
  void sent(const modbus::ReadRequest& request, protocol::HostTime at) ABBE_RT;
  Progress push(std::span<const std::byte> bytes, protocol::HostTime at) ABBE_RT;

  [[nodiscard]] const protocol::EnvironmentSample& sample() const ABBE_RT { return sample_; }
  [[nodiscard]] const EnvironmentFailure& failure() const ABBE_RT { return failure_; }
  [[nodiscard]] const EnvironmentCounters& counters() const ABBE_RT { return counters_; }
  [[nodiscard]] const RegisterMap& map() const noexcept { return map_; }

  /// Replay: processes one recorded block. Returns true if sample() is new.
  bool on_raw(const protocol::RawBlock& block) ABBE_RT;

 private:
  /// Place of a register's value in the answers: index of the read, and of the byte in its answer.
  struct Spot {
    std::size_t read = 0;
    std::size_t byte = 0;
  };
  [[nodiscard]] static std::vector<Spot> spots_in(const std::vector<modbus::ReadRequest>& reads,
                                                  const std::vector<RegisterPlace>& places,
                                                  int base_offset);

  Progress fail(const EnvironmentFailure& failure) ABBE_RT;
  Progress accept(std::span<const std::byte> registers) ABBE_RT;
  Progress prove(std::span<const std::byte> registers) ABBE_RT;
  Progress measure(std::span<const std::byte> registers) ABBE_RT;
  [[nodiscard]] bool take_value(std::size_t index, double value) ABBE_RT;
  void finish_round() ABBE_RT;
  void join() ABBE_RT;

  RegisterMap map_;
  modbus::Transport transport_;
  std::vector<modbus::ReadRequest> proving_reads_;
  std::vector<modbus::ReadRequest> reads_;
  std::vector<Spot> spots_;  ///< one element for each register in map_.measured

  bool begun_ = false;
  bool proven_ = false;
  bool first_round_ = true;
  std::size_t read_ = 0;  ///< index of the next read in proving_reads_ or reads_
  std::optional<modbus::ReadRequest> pending_;
  std::array<std::byte, 2 * modbus::kMaxAduSize> bytes_{};
  std::size_t filled_ = 0;
  protocol::HostTime asked_{};     ///< time of the first request of the round
  protocol::HostTime answered_{};  ///< time of the latest answer
  protocol::EnvironmentSample building_;
  protocol::EnvironmentSample sample_;
  EnvironmentFailure failure_;
  EnvironmentCounters counters_;
};

}  // namespace abbe::drivers
