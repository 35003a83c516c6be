#include "daemon/gateway_loop.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <ctime>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>
#include <utility>

namespace vgyro::daemon {
namespace {

constexpr std::uint32_t kEventsTag = 0xFFFFFFFF;
constexpr std::uint64_t kSecondUsec = 1'000'000;
constexpr int kPollMostMs = 1000;

// Two periods of a 100-Hz gyro: what the bus has not taken by then is worth less than its
// successor.
constexpr Duration kPatience = std::chrono::milliseconds(20);
// A process that was stopped must not send its backlog.
constexpr Duration kAgeMost = std::chrono::milliseconds(250);

TimePoint host_clock() {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  return time_from_ns(static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec);
}

std::vector<can::Filter> filters_of(const gateway::Plan& plan, std::size_t bus) {
  std::vector<can::Filter> filters;
  for (const gateway::FrameMatch& match : plan.inputs()) {
    if (match.bus == bus) filters.push_back({match.id, match.mask, match.extended});
  }
  return filters;
}

}  // namespace

GatewayLoop::GatewayLoop(const gateway::Plan& plan, StateKeeper* keeper, Log& log)
    : plan_(plan),
      keeper_(keeper),
      log_(log),
      reporter_({plan.gyros[0].name, plan.gyros[1].name}, plan.calibration.rest_s, log),
      pipeline_(plan) {
  buses_.reserve(plan.buses.size());
  for (std::size_t i = 0; i < plan.buses.size(); ++i) {
    buses_.emplace_back(plan.buses[i], filters_of(plan, i), log);
  }
}

GatewayLoop::~GatewayLoop() {
  if (epoll_fd_ >= 0) ::close(epoll_fd_);
}

Expected<void> GatewayLoop::start() {
  epoll_fd_ = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll_fd_ < 0) return fail("epoll", system_reason(errno));
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    if (const Expected<void> opened = buses_[i].open(); !opened) return opened;
    if (!poll_bus(i)) return fail(buses_[i].name(), "cannot poll: " + system_reason(errno));
  }
  if (const Expected<void> checked = check_output(); !checked) return checked;
  take_up_state();
  return start_events();
}

void GatewayLoop::take_up_state() {
  if (keeper_ == nullptr) return;
  const std::optional<gateway::SavedState> state = keeper_->load(plan_);
  if (!state) return;
  if (const Expected<void> taken = pipeline_.resume(*state); !taken) {
    log_.notice("saved state: {}", taken.error().message());
  }
}

Expected<void> GatewayLoop::check_output() const {
  const Bus& output = buses_[plan_.output.bus];
  if (!plan_.output.fd || output.socket().fd_frames()) return {};
  return fail(output.name(), "carries no CAN FD frames, but the config says `[output] fd = true`",
              "set `fd = false`, or enable FD on the link (`ip link set " + output.name() +
                  " mtu 72` for vcan, `type can … dbitrate … fd on` for a controller)");
}

bool GatewayLoop::poll_bus(std::size_t index) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u32 = static_cast<std::uint32_t>(index);
  return ::epoll_ctl(epoll_fd_, EPOLL_CTL_ADD, buses_[index].socket().fd(), &event) == 0;
}

Expected<void> GatewayLoop::start_events() {
  sd_event* events = nullptr;
  int result = sd_event_new(&events);
  if (result < 0) return fail("sd-event", system_reason(-result));
  events_.reset(events);

  sigset_t signals;
  ::sigemptyset(&signals);
  ::sigaddset(&signals, SIGTERM);
  ::sigaddset(&signals, SIGINT);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  result = sd_event_add_signal(events, nullptr, SIGTERM, &on_signal, this);
  if (result >= 0) result = sd_event_add_signal(events, nullptr, SIGINT, &on_signal, this);
  if (result >= 0) {
    result = sd_event_add_time_relative(events, nullptr, CLOCK_MONOTONIC, kSecondUsec, 0,
                                        &on_second, this);
  }
  if (result < 0) return fail("sd-event", system_reason(-result));

  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u32 = kEventsTag;
  if (::epoll_ctl(epoll_fd_, EPOLL_CTL_ADD, sd_event_get_fd(events), &event) != 0) {
    return fail("sd-event", system_reason(errno));
  }
  return {};
}

Expected<void> GatewayLoop::run() {
  std::array<epoll_event, 16> ready{};
  if (const Expected<void> armed = serve_events(false); !armed) return armed;
  sd_notify(0, "READY=1\nSTATUS=waiting for both gyros");
  for (const Bus& bus : buses_) {
    log_.info("{}: bound{}", bus.name(), bus.socket().fd_frames() ? ", CAN FD" : "");
  }
  now_ = host_clock();
  while (!stopping_) {
    const int count =
        ::epoll_wait(epoll_fd_, ready.data(), static_cast<int>(ready.size()), timeout_ms());
    if (count < 0 && errno != EINTR) return fail("epoll", system_reason(errno));
    const std::span<const epoll_event> events{ready.data(),
                                              static_cast<std::size_t>(std::max(count, 0))};
    if (const Expected<void> done = cycle(events); !done) return done;
  }
  sd_notify(0, "STOPPING=1\nSTATUS=stopping");
  if (keeper_ != nullptr) keeper_->finish(pipeline_.memory());
  reporter_.summarize(pipeline_.status(), traffic());
  return {};
}

// sd-event inside another loop: armed once, and again only after it had something to do.
Expected<void> GatewayLoop::serve_events(bool armed) {
  int result = armed ? sd_event_wait(events_.get(), 0) : 0;
  for (;;) {
    if (result > 0) result = sd_event_dispatch(events_.get());
    if (result >= 0) result = sd_event_prepare(events_.get());
    if (result == 0) return {};
    if (result < 0) return fail("sd-event", system_reason(-result));
  }
}

Expected<void> GatewayLoop::cycle(std::span<const epoll_event> ready) {
  now_ = host_clock();
  bool events_ready = false;
  for (const epoll_event& event : ready) {
    if (event.data.u32 == kEventsTag) {
      events_ready = true;
      continue;
    }
    if ((event.events & EPOLLOUT) != 0) queue_.on_writable();
    if ((event.events & ~std::uint32_t{EPOLLOUT}) != 0) buses_[event.data.u32].begin_reading(now_);
  }
  hand_on_arrivals();
  if (now_ >= pipeline_.next_deadline()) {
    // Frames that came before now_ but after poll had looked count before the time-out does.
    for (Bus& bus : buses_)
      bus.begin_reading(now_);
    hand_on_arrivals();
    if (all_drained()) pipeline_.advance(now_, *this);
  }
  flush();
  if (std::exchange(has_spoken_, false)) reporter_.check_state(pipeline_.status());
  return events_ready ? serve_events(true) : Expected<void>{};
}

void GatewayLoop::hand_on_arrivals() {
  Arrival arrival;
  while (Bus* bus = earliest(arrival)) {
    const auto index = static_cast<can::BusIndex>(bus - buses_.data());
    pipeline_.receive(index, *arrival.frame, arrival.stamp, *this);
    bus->take();
    flush();
  }
}

Bus* GatewayLoop::earliest(Arrival& arrival) {
  Bus* from = nullptr;
  for (Bus& bus : buses_) {
    const Arrival candidate = bus.peek();
    if (candidate.frame == nullptr) continue;
    if (from == nullptr || candidate.stamp < arrival.stamp) {
      from = &bus;
      arrival = candidate;
    }
  }
  return from;
}

void GatewayLoop::put(const can::Frame& frame, TimePoint stamp) {
  queue_.push(frame, std::min(stamp + kAgeMost, now_ + kPatience));
  has_spoken_ = true;
}

void GatewayLoop::flush() {
  if (queue_.size() == 0) return;
  queue_.drain(now_, buses_[plan_.output.bus]);
  if (queue_.wants_writable() != polls_writable_) poll_writable(!polls_writable_);
}

void GatewayLoop::poll_writable(bool wanted) {
  const Bus& output = buses_[plan_.output.bus];
  if (!output.is_open()) return;
  epoll_event event{};
  event.events = EPOLLIN | (wanted ? std::uint32_t{EPOLLOUT} : 0U);
  event.data.u32 = plan_.output.bus;
  if (::epoll_ctl(epoll_fd_, EPOLL_CTL_MOD, output.socket().fd(), &event) == 0) {
    polls_writable_ = wanted;
  }
}

// Never zero: a deadline that somehow stays in the past must not turn into a busy loop.
int GatewayLoop::timeout_ms() const {
  const TimePoint deadline =
      std::min(pipeline_.next_deadline(), queue_.next_deadline().value_or(TimePoint::max()));
  if (deadline <= now_) return 1;
  if (deadline > now_ + std::chrono::milliseconds(kPollMostMs)) return kPollMostMs;
  return static_cast<int>(std::chrono::ceil<std::chrono::milliseconds>(deadline - now_).count());
}

bool GatewayLoop::all_drained() const {
  return std::all_of(buses_.begin(), buses_.end(), [](const Bus& bus) { return bus.drained(); });
}

Traffic GatewayLoop::traffic() const {
  Traffic sum;
  for (const Bus& bus : buses_) {
    sum.received += bus.received();
    sum.lost_by_kernel += bus.lost();
  }
  sum.transmitted = queue_.counts();
  return sum;
}

void GatewayLoop::second_passed() {
  for (Bus& bus : buses_)
    bus.check_link();
  reopen_dead_buses();
  const std::string status = reporter_.second_passed(pipeline_.status(), traffic());
  sd_notify(0, ("STATUS=" + status).c_str());
  if (keeper_ != nullptr && keeper_->second_passed()) keeper_->keep(pipeline_.memory());
}

void GatewayLoop::reopen_dead_buses() {
  for (std::size_t i = 0; i < buses_.size(); ++i) {
    if (buses_[i].is_open() || !buses_[i].open() || !poll_bus(i)) continue;
    log_.notice("{}: open again", buses_[i].name());
    if (i == plan_.output.bus) {
      polls_writable_ = false;
      queue_.on_writable();
    }
  }
}

int GatewayLoop::on_signal(sd_event_source*, const signalfd_siginfo*, void* self) {
  static_cast<GatewayLoop*>(self)->stopping_ = true;
  return 0;
}

int GatewayLoop::on_second(sd_event_source* source, std::uint64_t, void* self) {
  static_cast<GatewayLoop*>(self)->second_passed();
  sd_event_source_set_time_relative(source, kSecondUsec);
  return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

}  // namespace vgyro::daemon
