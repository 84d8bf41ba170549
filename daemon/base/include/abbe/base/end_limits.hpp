#pragma once
/// The longest times that the parts of abbed may take when abbed ends. Their sum fits into
/// TimeoutStopSec of abbed.service, after which systemd kills abbed. A test compares the sum with
/// the unit file.

#include <chrono>

namespace abbe::daemon {

/// Longest time to close the control socket (3 s at most), the journal and the hub. If this takes
/// longer, abbed exits at once.
inline constexpr std::chrono::seconds kLongestHubEnd{5};
/// Longest time to end a running identification and to store models that are not stored yet.
inline constexpr std::chrono::seconds kLongestWorkEnd{4};
/// Longest time to write the last state of the counters.
inline constexpr std::chrono::seconds kLongestCountingEnd{3};
/// Longest time to connect to a moving measuring machine again, if the present connection is lost.
inline constexpr std::chrono::seconds kLongestMachineConnect{3};
/// Longest wait for the answer to AbortE: the largest allowed [cmm] command_timeout_s.
inline constexpr std::chrono::seconds kLongestMachineAnswer{5};
/// Longest time to write the state of the measuring machine to its file.
inline constexpr std::chrono::seconds kLongestHoldEnd{3};
/// Longest time to end abbe-dds, a child process of abbed: from SIGTERM to SIGKILL.
inline constexpr std::chrono::seconds kLongestDdsEnd{3};

/// Sum of all times above, plus time for the disk. If the end takes longer, abbed exits at once.
inline constexpr std::chrono::seconds kLongestEnd{27};
static_assert(kLongestHubEnd + kLongestWorkEnd + kLongestCountingEnd + kLongestMachineConnect +
                  kLongestMachineAnswer + kLongestHoldEnd + kLongestDdsEnd <
              kLongestEnd);

}  // namespace abbe::daemon
