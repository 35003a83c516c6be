#include "daemon/gateway_loop.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <ctime>
#include <exception>
#include <limits>
#include <new>
#include <sys/signalfd.h>
#include <unistd.h>
#include <utility>

#include "base/instance_name.h"

namespace vgyro::daemon {
namespace {

constexpr std::uint32_t kEventsTag = 0xFFFFFFFF;
constexpr std::uint32_t kTimerTag = 0xFFFFFFFE;
constexpr std::uint32_t kLoaderTag = 0xFFFFFFFD;
constexpr std::uint64_t kSecondUsec = 1'000'000;

// Older frames are dropped: a process that was stopped must not send its backlog.
constexpr Duration kAgeMost = std::chrono::milliseconds(250);

// The kernel raises this to its minimum, some six frames. Frames that the bus does not take wait in
// the transmit queue, which drops stale ones; the kernel would send them in a burst.
constexpr int kSendBufferBytes = 1;

template <clockid_t Clock>
TimePoint read_clock() {
  timespec now{};
  ::clock_gettime(Clock, &now);
  return time_from_ns(static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec);
}

// The inputs, and our own identifiers, which no other node should send.
std::vector<can::Filter> filters_of(const gateway::Plan& plan, std::size_t bus) {
  std::vector<can::Filter> filters;
  const auto index = static_cast<can::BusIndex>(bus);
  for (const gateway::FrameId& own : gateway::output_ids(plan.output, index)) {
    filters.push_back(
        {own.id, own.extended ? can::kExtendedIdMax : can::kStandardIdMax, own.extended});
  }
  for (const gateway::FrameMatch& match : plan.inputs()) {
    if (match.bus == bus) filters.push_back({match.id, match.mask, match.extended});
  }
  return filters;
}

}  // namespace

GatewayLoop::Setup::Setup(gateway::Plan the_plan, TurnClock& clock, Log& log)
    : plan(std::move(the_plan)),
      reporter(std::make_unique<Reporter>(std::array{plan.gyros[0].name, plan.gyros[1].name},
                                          plan.calibration.rest_s, log)),
      pipeline(plan),
      outlets(plan.buses, plan.output.transmit) {
  buses.reserve(plan.buses.size());
  for (std::size_t i = 0; i < plan.buses.size(); ++i) {
    can::SocketOptions options;
    options.send_buffer_bytes = kSendBufferBytes;
    IdentifierWatch own(gateway::output_ids(plan.output, static_cast<can::BusIndex>(i)));
    buses.emplace_back(plan.buses[i], filters_of(plan, i), std::move(own), options, clock, log);
  }
}

GatewayLoop::GatewayLoop(LoadedConfig config, LoadPlan load, std::string instance,
                         Companions companions, Log& log)
    : loader_(std::move(load)),
      keeper_(companions.keeper),
      metrics_(companions.metrics),
      capture_(companions.capture),
      log_(log),
      clock_(&read_clock<CLOCK_REALTIME>, &read_clock<CLOCK_MONOTONIC>),
      setup_(std::make_unique<Setup>(std::move(config.plan), clock_, log)) {
  snapshot_.fingerprint = std::move(config.fingerprint);
  snapshot_.instance = std::move(instance);
  if (capture_ != nullptr) capture_->use(setup_->plan, snapshot_.fingerprint);
}

GatewayLoop::~GatewayLoop() {
  if (epoll_fd_ >= 0) ::close(epoll_fd_);
}

Expected<void> GatewayLoop::start() {
  epoll_fd_ = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll_fd_ < 0) return fail("epoll", system_reason(errno));
  if (Expected<void> opened = open_buses(*setup_); !opened) return opened;
  if (Expected<void> polled = poll_buses(); !polled) return polled;
  tell_of_shadow(setup_->plan.output);
  take_up_state();
  return start_events();
}

Expected<void> GatewayLoop::open_buses(Setup& setup) {
  for (Bus& bus : setup.buses) {
    if (Expected<void> opened = bus.open(); !opened) return opened;
  }
  return check_output(setup);
}

Expected<void> GatewayLoop::check_output(const Setup& setup) {
  const gateway::OutputPlan& output = setup.plan.output;
  if (output.fd && output.vgyro_frames) {
    Expected<void> fits =
        check_fd(setup.buses[output.bus], "but the config says `[output] fd = true`");
    if (!fits) return fits;
  }
  for (const gateway::OutputLayout& layout : output.layouts) {
    if (!layout.fd) continue;
    Expected<void> fits =
        check_fd(setup.buses[layout.bus], "which " + layout.message + " of [[output.layout]] is");
    if (!fits) return fits;
  }
  return {};
}

Expected<void> GatewayLoop::check_fd(const Bus& output, const std::string& wanted) {
  // A link that is down may still be given another MTU before it is up.
  if (!output.is_up() || output.carries_fd()) return {};
  return fail(output.name(), "carries no CAN FD frames, " + wanted,
              "choose another frame or bus (`fd = false` is classic CAN), or enable FD on the link "
              "(`ip link set " +
                  output.name() +
                  " mtu 72` for vcan, `type can … dbitrate … fd on` for a controller)");
}

Expected<void> GatewayLoop::poll_buses() {
  for (std::size_t i = 0; i < setup_->buses.size(); ++i) {
    const Bus& bus = setup_->buses[i];
    if (bus.is_open() && !poll_bus(i)) return fail(bus.name(), "cannot poll: " + system_reason());
  }
  return {};
}

bool GatewayLoop::poll_bus(std::size_t index) {
  return poll_readable(setup_->buses[index].socket().fd(), static_cast<std::uint32_t>(index));
}

bool GatewayLoop::poll_readable(int fd, std::uint32_t tag) const {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u32 = tag;
  return ::epoll_ctl(epoll_fd_, EPOLL_CTL_ADD, fd, &event) == 0;
}

void GatewayLoop::take_up_state() {
  if (keeper_ == nullptr) return;
  const std::optional<gateway::SavedState> state = keeper_->load(setup_->plan);
  if (!state) return;
  if (const Expected<void> taken = setup_->pipeline.resume(*state); !taken) {
    log_.notice("saved state: {}", taken.error().message());
  }
}

Expected<void> GatewayLoop::start_events() {
  sd_event* events = nullptr;
  int result = sd_event_new(&events);
  if (result < 0) return fail("sd-event", system_reason(-result));
  events_.reset(events);

  sigset_t signals;
  ::sigemptyset(&signals);
  for (const int number : {SIGTERM, SIGINT, SIGHUP, SIGUSR1})
    ::sigaddset(&signals, number);
  ::pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  result = sd_event_add_signal(events, nullptr, SIGTERM, &on_stop, this);
  if (result >= 0) result = sd_event_add_signal(events, nullptr, SIGINT, &on_stop, this);
  if (result >= 0) result = sd_event_add_signal(events, nullptr, SIGHUP, &on_hangup, this);
  if (result >= 0) result = sd_event_add_signal(events, nullptr, SIGUSR1, &on_debug, this);
  if (result >= 0) {
    result = sd_event_add_time_relative(events, nullptr, CLOCK_MONOTONIC, kSecondUsec, 0,
                                        &on_second, this);
  }
  watchdog_half_usec_ = watchdog_usec() / 2;
  if (result >= 0 && watchdog_half_usec_ > 0) {
    result = sd_event_add_time_relative(events, nullptr, CLOCK_MONOTONIC, watchdog_half_usec_, 1,
                                        &on_watchdog, this);
  }
  if (result < 0) return fail("sd-event", system_reason(-result));

  if (!poll_readable(sd_event_get_fd(events), kEventsTag)) {
    return fail("sd-event", system_reason(errno));
  }
  if (Expected<void> opened = timer_.open(); !opened) return opened;
  if (!poll_readable(timer_.fd(), kTimerTag)) return fail("timerfd", system_reason(errno));
  if (Expected<void> opened = loader_.open(); !opened) return opened;
  if (!poll_readable(loader_.fd(), kLoaderTag)) return fail("eventfd", system_reason(errno));
  return {};
}

Expected<void> GatewayLoop::run() {
  std::array<epoll_event, 16> ready{};
  started_ = clock_.steady();
  control_.emplace(
      events_.get(),
      Control::Gateway{
          .snapshot = [this]() -> const Snapshot& { return snapshot(); },
          .recalibrate = [this] { recalibration_wanted_ = true; },
          .save_state = [this] { return save_state(); },
          .capture = [this](Capture::Answer answer) { return ask_for_capture(std::move(answer)); }},
      bus_name_of(snapshot_.instance), log_);
  if (Expected<void> armed = serve_events(false); !armed) return armed;
  notifier_.ready(status_line());
  set_alarm();
  while (!stopping_) {
    const int count = ::epoll_wait(epoll_fd_, ready.data(), static_cast<int>(ready.size()), -1);
    if (count < 0 && errno != EINTR) return fail("epoll", system_reason(errno));
    const std::span<const epoll_event> events{ready.data(),
                                              static_cast<std::size_t>(std::max(count, 0))};
    if (Expected<void> done = turn(events); !done) return done;
  }
  notifier_.stopping();
  if (keeper_ != nullptr) keeper_->finish(memory());
  if (capture_ != nullptr) capture_->finish();
  setup_->reporter->summarize(setup_->pipeline.status(), traffic());
  return {};
}

// Runs sd-event inside the epoll loop: it is armed once, and again only after it had something to
// do.
Expected<void> GatewayLoop::serve_events(bool armed) {
  int result = armed ? sd_event_wait(events_.get(), 0) : 0;
  for (;;) {
    if (result > 0) result = sd_event_dispatch(events_.get());
    if (result >= 0) result = sd_event_prepare(events_.get());
    if (result == 0) return {};
    if (result < 0) return fail("sd-event", system_reason(-result));
  }
}

Expected<void> GatewayLoop::turn(std::span<const epoll_event> ready) {
  clock_.begin_turn();
  bool events_ready = false;
  bool loaded = false;
  rang_ = false;
  for (const epoll_event& event : ready) {
    if (event.data.u32 == kEventsTag) {
      events_ready = true;
    } else if (event.data.u32 == kTimerTag) {
      rang_ = true;
    } else if (event.data.u32 == kLoaderTag) {
      loaded = true;
    } else {
      if ((event.events & EPOLLOUT) != 0) setup_->outlets[event.data.u32].queue.on_writable();
      if ((event.events & ~std::uint32_t{EPOLLOUT}) != 0)
        setup_->buses[event.data.u32].begin_reading();
    }
  }
  hand_on_arrivals();
  if (rang_) look_at_time();
  flush();
  const std::uint64_t spoken = setup_->pipeline.spoken();
  const bool spoke = std::exchange(spoken_, spoken) != spoken;
  if (std::exchange(has_spoken_, false) || spoke) look_at_status();
  if (events_ready) {
    if (Expected<void> done = serve_events(true); !done) return done;
    if (Expected<void> done = do_what_was_asked(); !done) return done;
  }
  if (loaded) {
    if (Expected<void> done = take_reloaded(); !done) return done;
  }
  set_alarm();
  return {};
}

// The present on the clock of the frames' stamps, without its backward steps.
TimePoint GatewayLoop::pipeline_now() {
  return forward_.update(clock_.wall(), clock_.steady());
}

// The stamps of frames advance the pipeline's time; this advances it when no frame comes.
void GatewayLoop::look_at_time() {
  const TimePoint now = pipeline_now();
  if (now < setup_->pipeline.next_deadline()) return;
  // Frames that came after epoll_wait() but before `now` must count before the time-out does.
  for (Bus& bus : setup_->buses)
    bus.begin_reading();
  hand_on_arrivals();
  if (all_drained()) setup_->pipeline.advance(now, *this);
}

void GatewayLoop::set_alarm() {
  const TimePoint due = setup_->pipeline.next_deadline();
  const TimePoint queue_due = setup_->outlets.next_deadline().value_or(TimePoint::max());
  if (!rang_ && !alarm_.is_late_for(due, queue_due)) return;
  timer_.set(alarm_.set(due, pipeline_now(), queue_due, clock_.steady()));
}

void GatewayLoop::look_at_status() {
  const gateway::Status& status = setup_->pipeline.status();
  setup_->reporter->check_state(status);
  for (std::size_t place = 0; place < setup_->pipeline.axis_count(); ++place) {
    const char axis = gateway::kAxisNames[setup_->plan.axes[place].axis];
    setup_->reporter->check_axis(place, axis, setup_->pipeline.axis_status(place));
  }
  const std::uint64_t samples = status.gyros[0].samples + status.gyros[1].samples;
  if (std::exchange(samples_, samples) != samples) {
    // Bounded, because a wrong stamp must not pass for the present.
    forward_.sample_came(std::min(newest_stamp_, alarm_.latest_now()));
  }
}

void GatewayLoop::hand_on_arrivals() {
  Arrival arrival;
  while (Bus* bus = earliest(arrival)) {
    const auto index = static_cast<can::BusIndex>(bus - setup_->buses.data());
    newest_stamp_ = arrival.stamp;
    setup_->pipeline.receive(index, *arrival.frame, arrival.stamp, *this);
    flush();
    if (capture_ != nullptr) capture_->put(index, *arrival.frame, arrival.stamp);
    bus->take();
  }
}

Bus* GatewayLoop::earliest(Arrival& arrival) {
  Bus* from = nullptr;
  for (Bus& bus : setup_->buses) {
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
  put_on(setup_->plan.output.bus, frame, stamp);
}

void GatewayLoop::put_on(can::BusIndex bus, const can::Frame& frame, TimePoint stamp) {
  const gateway::OutputPlan& output = setup_->plan.output;
  // Every frame but VG_Bias and VG_Model goes out with a rate.
  const bool is_own = output.vgyro_frames && bus == output.bus && !frame.has(can::kExtended);
  const bool is_bias = is_own && (frame.id == output.bias_id || frame.id == output.model_id);
  if (!is_bias) patience_.rate_at(stamp);
  Outlets& outlets = setup_->outlets;
  if (!is_timely(stamp) || !outlets.send_at_once(bus, frame, setup_->buses[bus])) {
    const Duration left = stamp + kAgeMost - clock_.wall();
    outlets.push(bus, frame, clock_.steady() + std::min(patience_.value(), left));
  }
  has_spoken_ = true;
}

// A process that was stopped finds its timer gone off, or many frames in one batch. If neither is
// so, the first frame of a turn can be judged by the time at which the timer is due, which saves
// reading the clock.
bool GatewayLoop::is_timely(TimePoint stamp) {
  const bool nothing_odd = !rang_ && !has_spoken_ &&
                           std::none_of(setup_->buses.begin(), setup_->buses.end(),
                                        [](const Bus& bus) { return bus.is_behind(); });
  if (nothing_odd && alarm_.latest_now() - stamp <= kAgeMost) return true;
  return clock_.wall() - stamp <= kAgeMost;
}

void GatewayLoop::flush() {
  for (std::size_t i = 0; i < setup_->outlets.size(); ++i) {
    Outlet& outlet = setup_->outlets[i];
    if (outlet.queue.size() == 0) continue;
    outlet.queue.drain(clock_.steady(), setup_->buses[i]);
    if (outlet.queue.wants_writable() != outlet.polls_writable) poll_writable(i);
  }
}

void GatewayLoop::poll_writable(std::size_t bus) {
  const Bus& output = setup_->buses[bus];
  if (!output.is_open()) return;
  const bool wanted = setup_->outlets[bus].queue.wants_writable();
  epoll_event event{};
  event.events = EPOLLIN | (wanted ? std::uint32_t{EPOLLOUT} : 0U);
  event.data.u32 = static_cast<std::uint32_t>(bus);
  if (::epoll_ctl(epoll_fd_, EPOLL_CTL_MOD, output.socket().fd(), &event) == 0) {
    setup_->outlets[bus].polls_writable = wanted;
  }
}

bool GatewayLoop::all_drained() const {
  return std::all_of(setup_->buses.begin(), setup_->buses.end(),
                     [](const Bus& bus) { return bus.drained(); });
}

Traffic GatewayLoop::traffic() const {
  Traffic traffic;
  for (const Bus& bus : setup_->buses)
    traffic.buses.push_back(bus.status());
  traffic.transmitted = setup_->outlets.counts();
  traffic.shadowed = setup_->outlets.shadowed();
  return traffic;
}

// --- slow work -----------------------------------------------------------------------------------

void GatewayLoop::second_passed() {
  for (Bus& bus : setup_->buses)
    bus.second_passed();
  reopen_dead_buses();
  look_whether_output_fits();
  stop_age_.count_is(setup_->pipeline.status().stops, clock_.steady());
  const std::string line = status_line();
  notifier_.status(line);
  log_.debug("{}", line);
  if (capture_ != nullptr) capture_->second_passed(setup_->pipeline.status(), clock_.wall());
  control_->second_passed();
  if (metrics_ != nullptr && metrics_->second_passed()) metrics_->write(snapshot());
  const std::optional<gateway::SavedState> known = memory();
  if (keeper_ != nullptr && keeper_->second_passed()) keeper_->keep(known);
}

std::string GatewayLoop::status_line() {
  try {
    return full_status_line();
  } catch (const std::bad_alloc&) {
    return "short of memory";
  }
}

std::string GatewayLoop::full_status_line() {
  std::string line = setup_->reporter->second_passed(setup_->pipeline.status(), traffic());
  if (!setup_->plan.output.transmit) line += "; shadow mode: nothing is sent";
  if (reload_refused_) line += "; the new configuration was refused";
  return line;
}

void GatewayLoop::reopen_dead_buses() {
  for (std::size_t i = 0; i < setup_->buses.size(); ++i) {
    Bus& bus = setup_->buses[i];
    if (bus.is_open() || !bus.open() || !bus.is_open() || !poll_bus(i)) continue;
    setup_->outlets[i].begin_anew();
  }
}

void GatewayLoop::look_whether_output_fits() {
  const Expected<void> fits = check_output(*setup_);
  const bool fitted = std::exchange(output_fits_, fits.has_value());
  if (fits || !fitted) return;
  log_.tell(Severity::kError, {.cause = "no_fd", .bus = fits.error().where}, "{}",
            fits.error().message());
}

// Not called while sd-event dispatches, because it replaces the buses.
Expected<void> GatewayLoop::do_what_was_asked() {
  if (std::exchange(reload_wanted_, false)) begin_reload();
  if (std::exchange(recalibration_wanted_, false)) recalibrate();
  return {};
}

void GatewayLoop::recalibrate() {
  log_.tell(Severity::kNotice, {.cause = "recalibrate"}, "calibration requested");
  const Expected<void> replaced = try_to_replace_setup(setup_->plan, false);
  if (!replaced) {
    log_.error("calibrating again: {}", replaced.error().message());
    return;
  }
  inheritance_.forget();
  if (keeper_ != nullptr) keeper_->forget();
}

// The state to save: the pipeline's, or the one from before a reload as long as that is better.
std::optional<gateway::SavedState> GatewayLoop::memory() {
  const bool was_contradicted = inheritance_.is_contradicted();
  std::optional<gateway::SavedState> known =
      inheritance_.choose(setup_->pipeline.memory(), setup_->plan, setup_->pipeline.status().stops);
  if (inheritance_.is_contradicted() && !was_contradicted) {
    log_.tell(Severity::kWarning, {.cause = "calibration_contradicted"},
              "the new calibration contradicts what was known of the gyros; did the platform turn? "
              "It is used, but not saved before a stop has confirmed it; `vgyro recalibrate` at "
              "rest begins afresh");
  }
  if (was_contradicted && !inheritance_.is_contradicted()) {
    log_.notice("a stop has decided for the new calibration; it is saved from now on");
  }
  return known;
}

Expected<void> GatewayLoop::save_state() {
  if (keeper_ == nullptr) {
    return fail({}, "the gateway keeps no state",
                "start it with --state FILE, or with StateDirectory= in its unit");
  }
  const std::optional<gateway::SavedState> known = memory();
  if (!known) return fail({}, "nothing was learned yet that is worth keeping");
  keeper_->keep(known);
  return {};
}

Expected<void> GatewayLoop::ask_for_capture(Capture::Answer answer) {
  if (capture_ == nullptr) {
    return fail({}, "the gateway keeps no recording of its inputs",
                "start it with --capture DIR; for the service, /etc/default/vgyrod has the line");
  }
  return capture_->ask(std::move(answer), clock_.wall());
}

// Made once per turn, because a request for all properties calls this for each of them.
const Snapshot& GatewayLoop::snapshot() {
  if (std::exchange(snapshot_at_, clock_.steady()) == clock_.steady() && snapshot_.plan != nullptr)
    return snapshot_;
  snapshot_.plan = &setup_->plan;
  snapshot_.status = setup_->pipeline.status();
  snapshot_.axes.clear();
  for (std::size_t place = 0; place < setup_->pipeline.axis_count(); ++place)
    snapshot_.axes.push_back(setup_->pipeline.axis_status(place));
  snapshot_.traffic = traffic();
  snapshot_.uptime_s = to_seconds(clock_.steady() - started_);
  snapshot_.last_stop_age_s = stop_age_.age_s(clock_.steady());
  snapshot_.config_refused = reload_refused_;
  snapshot_.log_lines_lost = log_.lost();
  snapshot_.service_messages_lost = notifier_.failures();
  if (capture_ != nullptr) snapshot_.capture = capture_->status();
  for (auto* values :
       {&snapshot_.bias_sigma_dps, &snapshot_.slope_dps_s, &snapshot_.slope_sigma_dps_s})
    values->fill(std::numeric_limits<double>::quiet_NaN());
  const std::optional<gateway::SavedState> known = setup_->pipeline.memory();
  if (known && std::isfinite(snapshot_.status.gyros[0].bias_dps)) {
    const std::array<double, 3>& covariance = known->drift.bias_covariance;
    snapshot_.bias_sigma_dps = {std::sqrt(covariance[0]), std::sqrt(covariance[2])};
    for (std::size_t k = 0; k < 2; ++k) {
      if (!(known->drift.slope_sigma_dps_s[k] > 0.0)) continue;  // 0 stands for "not known"
      snapshot_.slope_dps_s[k] = known->drift.slope_dps_s[k];
      snapshot_.slope_sigma_dps_s[k] = known->drift.slope_sigma_dps_s[k];
    }
  }
  return snapshot_;
}

// The gateway goes on with the old configuration until the new one is known to work.
void GatewayLoop::begin_reload() {
  if (!loader_.is_busy()) {
    notifier_.reloading();
    log_.info("reading the configuration again");
  }
  loader_.ask();
}

Expected<void> GatewayLoop::take_reloaded() {
  std::optional<LoadResult> loaded = loader_.take();
  if (!loaded) return {};
  tell_config(*loaded, log_);
  reload_refused_ = !*loaded;
  if (*loaded) {
    const Expected<void> replaced = try_to_replace_setup(std::move((*loaded)->plan), true);
    if (!replaced) log_.error("{}", replaced.error().message());
    reload_refused_ = !replaced;
    if (replaced) {
      set_log_level(**loaded, log_);
      snapshot_.fingerprint = std::move((*loaded)->fingerprint);
      log_.info("the configuration's fingerprint is {}", snapshot_.fingerprint);
      if (capture_ != nullptr) capture_->use(setup_->plan, snapshot_.fingerprint);
    }
  }
  if (reload_refused_) {
    log_.tell(Severity::kError, {.cause = "config_refused"},
              "the new configuration is refused; the old one stays in force");
  }
  clock_.begin_turn();
  if (!loader_.is_busy()) notifier_.ready(status_line());
  return {};
}

Expected<void> GatewayLoop::try_to_replace_setup(gateway::Plan plan, bool keep) {
  try {
    return replace_setup(std::move(plan), keep);
  } catch (const std::bad_alloc&) {
    return fail({}, "there is not enough memory for a second configuration beside the first");
  }
}

// Allocates everything before it gives up any part of the present setup.
Expected<void> GatewayLoop::replace_setup(gateway::Plan plan, bool keep) {
  auto next = std::make_unique<Setup>(std::move(plan), clock_, log_);
  if (Expected<void> opened = open_buses(*next); !opened) return opened;
  // The old pipeline takes the frames received so far; the new sockets drop their copies of them.
  clock_.begin_turn();
  for (Bus& bus : setup_->buses)
    bus.begin_reading();
  hand_on_arrivals();
  for (Bus& bus : next->buses)
    bus.discard();
  const std::string how = keep ? hand_over(*next) : begin_anew(*next);
  next->outlets.take_over(std::move(setup_->outlets));
  setup_ = std::move(next);
  snapshot_.plan = nullptr;
  spoken_ = setup_->pipeline.spoken();
  log_.notice("{}", how);
  tell_of_shadow(setup_->plan.output);
  return poll_buses();
}

// Called when a configuration takes effect, and each time, so that shadow mode is not forgotten.
void GatewayLoop::tell_of_shadow(const gateway::OutputPlan& output) {
  if (output.transmit) return;
  log_.tell(Severity::kWarning, {.cause = "shadow"},
            "shadow mode: everything but sending is done, and no frame goes out; `[output] "
            "transmit = true`, or no such line, and a reload end it");
}

// Gives the next pipeline what the present one has learned, as far as it can use it. Returns the
// text for the log.
std::string GatewayLoop::hand_over(Setup& next) {
  if (gateway::same_but_output(setup_->plan, next.plan)) {
    std::string how =
        "the new configuration is in use; its gyros are the same: nothing was interrupted";
    next.pipeline.take_over(std::move(setup_->pipeline));
    next.reporter = std::move(setup_->reporter);
    next.reporter->buses_are_new();
    return how;
  }
  const std::optional<gateway::SavedState> known = memory();
  begin_anew(next);
  const Expected<void> resumed =
      known ? next.pipeline.resume(*known) : Expected<void>(fail({}, "nothing was learned yet"));
  if (resumed) {
    inheritance_.forget();
    return "the new configuration is in use, with what was learned";
  }
  if (known) inheritance_.keep(*known);
  return "the new configuration is in use; calibrating again: " + resumed.error().message();
}

std::string GatewayLoop::begin_anew(Setup& next) {
  next.pipeline.count_on_from(setup_->pipeline);
  next.reporter->start_from(setup_->outlets.counts());
  return "calibrating again";
}

int GatewayLoop::on_stop(sd_event_source*, const signalfd_siginfo*, void* self) {
  static_cast<GatewayLoop*>(self)->stopping_ = true;
  return 0;
}

int GatewayLoop::on_hangup(sd_event_source*, const signalfd_siginfo*, void* self) {
  static_cast<GatewayLoop*>(self)->reload_wanted_ = true;
  return 0;
}

int GatewayLoop::on_debug(sd_event_source*, const signalfd_siginfo*, void* self) {
  static_cast<GatewayLoop*>(self)->log_.toggle_debug();
  return 0;
}

int GatewayLoop::on_second(sd_event_source* source, std::uint64_t, void* self) {
  // Rates need neither memory nor a further thread, so the reports of this second just wait.
  auto& loop = *static_cast<GatewayLoop*>(self);
  try {
    loop.second_passed();
    loop.told_of_shortage_ = false;
  } catch (const std::exception& error) {
    if (!std::exchange(loop.told_of_shortage_, true))
      loop.log_.warning("the system is short of resources: {}", error.what());
  }
  sd_event_source_set_time_relative(source, kSecondUsec);
  return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

int GatewayLoop::on_watchdog(sd_event_source* source, std::uint64_t, void* self) {
  auto& loop = *static_cast<GatewayLoop*>(self);
  if (loop.life_.has_moved(loop.clock_.steady(), loop.setup_->pipeline.spoken()))
    loop.notifier_.alive();
  sd_event_source_set_time_relative(source, loop.watchdog_half_usec_);
  return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
}

}  // namespace vgyro::daemon
