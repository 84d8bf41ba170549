#pragma once
/// How long the parts of abbed may take when it ends. Together they fit into TimeoutStopSec of
/// abbed.service, after which systemd kills abbed; a test compares them with the unit.

#include <chrono>

namespace abbe::daemon {

/// Control socket (3 s at most), journal and hub. Then abbed exits at once.
inline constexpr std::chrono::seconds kLongestHubEnd{5};
/// A running identification and models that are not stored.
inline constexpr std::chrono::seconds kLongestWorkEnd{4};
/// The last state of the counters.
inline constexpr std::chrono::seconds kLongestCountingEnd{3};
/// A measuring machine that moves: another connection, if the present one is lost, ...
inline constexpr std::chrono::seconds kLongestMachineConnect{3};
/// ... and the answer to AbortE: the largest [cmm] command_timeout_s.
inline constexpr std::chrono::seconds kLongestMachineAnswer{5};
/// The state of the measuring machine in its file.
inline constexpr std::chrono::seconds kLongestHoldEnd{3};
/// abbe-dds as a child of abbed: from SIGTERM to SIGKILL.
inline constexpr std::chrono::seconds kLongestDdsEnd{3};

/// All of them one after the other, and the disk. Then abbed exits at once.
inline constexpr std::chrono::seconds kLongestEnd{27};
static_assert(kLongestHubEnd + kLongestWorkEnd + kLongestCountingEnd + kLongestMachineConnect +
                  kLongestMachineAnswer + kLongestHoldEnd + kLongestDdsEnd <
              kLongestEnd);

}  // namespace abbe::daemon
