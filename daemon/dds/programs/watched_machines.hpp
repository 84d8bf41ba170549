#pragma once
/// The display of abbe-watch: what participants published about each machine, and the lines that
/// are printed when it changes. Used by one thread.

#include <chrono>
#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "abbe/dds/participant_addresses.hpp"
#include "abbe/dds/readers.hpp"
#include "abbe/dds/received_model.hpp"
#include "abbe/subscriber/publisher_pin.hpp"

namespace abbe::dds {

struct WatchOptions {
  std::string machine;      ///< empty: all machines
  std::string machine_id;   ///< identity of this machine; empty: the first identity is pinned
  bool json = false;        ///< one line with a JSON object per sample, instead of text
  bool keep_grids = false;  ///< for applicable()
};

/// Keeps the received data of every machine, and prints what has changed.
class WatchedMachines {
 public:
  /// `readers` and `addresses` must outlive this object.
  WatchedMachines(WatchOptions options, const Readers& readers,
                  const ParticipantAddresses& addresses);

  /// True once a sample of a machine that is watched has arrived.
  [[nodiscard]] bool received() const { return received_; }
  void take(const Arrival& arrival);
  /// Discards the ModelState of each publisher that is not alive, and shows the change. A publisher
  /// that becomes alive again repeats its ModelState within a second. Also withdraws the decision
  /// to apply the last vector when the vector may no longer be applied, even if no further sample
  /// arrives.
  void notice_losses();
  /// Time until the next of the applied vectors becomes older than its validity, at most `at_most`.
  [[nodiscard]] std::chrono::milliseconds until_next_loss(std::chrono::milliseconds at_most) const;
  /// The first received model that is complete and may be applied; nullptr if there is none.
  [[nodiscard]] const ReceivedModel* applicable() const;
  /// The reason why applicable() is nullptr, for each machine.
  [[nodiscard]] std::string why_not() const;

 private:
  using WallClock = std::chrono::steady_clock;

  /// The data that one participant published about one machine.
  struct Publisher {
    ReceivedModel model;
    std::optional<WriterId> state_from;  ///< writer of the last valid ModelState
    WallClock::time_point state_at{};    ///< time at which this ModelState arrived
    std::string position;
    /// The last samples of the durable topics, until the publisher is pinned, for --json.
    std::map<std::pair<daemon::Topic, std::string>, std::vector<std::byte>> not_shown;
    std::size_t not_shown_bytes = 0;
    Delay delay;
    std::optional<std::chrono::nanoseconds> last_delay;  ///< delay of the last vector
  };

  /// The last vector of a machine, while it may be applied.
  struct Applied {
    v1::Compensation vector;
    std::chrono::nanoseconds delay;  ///< delay of the vector when it arrived
    WallClock::time_point arrived, valid_until;
  };

  /// Several participants of a domain may publish data of the same machine. Only the data of the
  /// pinned publisher is shown and used.
  struct Machine {
    PublisherPin pin;
    std::map<ParticipantId, Publisher> publishers;
    bool shown_alive = false;
    std::string shown_state, shown_model;
    std::optional<Applied> applied;
    bool shown_apply = false;
    WallClock::time_point last_live{};
    std::optional<WallClock::time_point> ignored_reported;
    bool without_identity_reported = false;
    /// The reason why no publisher is pinned.
    std::string why_none = "no publisher has stated its identity (topic abbe/v1/Identity)";

    /// The pinned publisher; nullptr: none is pinned.
    [[nodiscard]] const Publisher* pinned() const {
      const auto found = pin.pinned() ? publishers.find(*pin.pinned()) : publishers.end();
      return found == publishers.end() ? nullptr : &found->second;
    }

    Publisher& publisher(const ParticipantId& id) {
      const auto [found, is_new] = publishers.try_emplace(id);
      if (is_new && pin.pinned() != id && pinned() != nullptr)
        found->second.delay = pinned()->delay.for_next_publisher();
      if (is_new) std::erase_if(publishers, [&](const auto& p) { return !pin.remembers(p.first); });
      return found->second;
    }
  };

  [[nodiscard]] bool alive(const Publisher* publisher) const;
  /// Sum over the publishers of all machines. Limits apply to this sum because other participants
  /// may publish under any number of names.
  template <class Value>
  [[nodiscard]] std::size_t total(Value value) const {
    std::size_t sum = 0;
    for (const auto& [name, machine] : machines_)
      for (const auto& [id, publisher] : machine.publishers) sum += value(publisher);
    return sum;
  }
  /// Keeps the data of a sample. Called also for publishers that are not pinned, because one of
  /// them may be pinned next.
  void keep(const Arrival& arrival, Publisher& publisher, bool pinned);
  /// Shows a sample of the pinned publisher, after keep().
  void show(const Arrival& arrival, const std::string& name, Machine& machine,
            const Publisher& publisher);
  void print_sample(daemon::Topic topic, std::span<const std::byte> payload);
  void print(const std::string& line);
  void show_liveness(const std::string& name, Machine& machine);
  /// Participant id and announced addresses; the addresses are not verified.
  [[nodiscard]] std::string described(const ParticipantId& id) const;
  void show_successor(const std::string& name, const ParticipantId& id,
                      const ParticipantId& former);
  /// Keeps a sample of a publisher that is not pinned until show_kept().
  void keep_for_later(const Arrival& arrival, Publisher& publisher);
  /// Shows the samples that arrived before the publisher was pinned.
  void show_kept(const std::string& name, Machine& machine, Publisher& publisher);
  [[nodiscard]] static PublisherPin::Verdict judge(const Arrival& arrival, PublisherPin& pin);
  /// Reports once that the publisher is pinned by its name alone.
  void report_without_identity(const std::string& name, Machine& machine, const ParticipantId& id);
  /// Reports, every 10 s, why the samples of `id` are not used.
  void report_ignored_publisher(const std::string& name, Machine& machine, const ParticipantId& id,
                                PublisherPin::Verdict verdict);
  void show_state(const std::string& name, Machine& machine, const Publisher& publisher);
  void show_model(Machine& machine, const Publisher& publisher);
  void show_health(const v1::Health& h);
  void show_event(const v1::CalibrationEvent& e);
  /// Decides on a vector that has just arrived, and keeps it while it may be applied.
  Decision decide_on(Machine& machine, const Publisher& publisher, const v1::Compensation& c) const;
  /// Shows that the vector that was to be applied may not be applied any more.
  void withdraw(const std::string& name, Machine& machine);
  /// Prints one line of JSON with the decision, the present time of CLOCK_MONOTONIC, and the
  /// validity from this time on.
  static void print_decision(const v1::Compensation& c, const Decision& decision);
  /// Prints the line with position, vector and decision. On a terminal the line is updated in
  /// place; otherwise a new line is printed once a second.
  void show_vector(Machine& machine, const Publisher& publisher, const v1::Compensation& c);

  const WatchOptions options_;
  const Readers& readers_;
  const ParticipantAddresses& addresses_;
  bool received_ = false;
  const bool on_terminal_;
  std::map<std::string, Machine> machines_;
  // last shown state, by machine and stream
  std::map<std::pair<std::string, std::string>, std::string> health_;
  std::map<std::string, std::string> calibration_;  // last shown state, by machine
};

}  // namespace abbe::dds
