# Runs in the guest, on a Debian that has just started: the whole life of the package. Each step leaves its output and exit
# code in out/, in the host's folder; the host judges them. Starting a program is slow here (45 ms).
here=/run/proof
out=$here/out
export LC_ALL=C SYSTEMD_COLORS=0 SYSTEMD_PAGER= DEBIAN_FRONTEND=noninteractive

step() {  # step NAME COMMAND...
    local name=$1; shift
    echo "$EPOCHREALTIME" >"$out/$name.at"
    "$@" >"$out/$name.txt" 2>&1 </dev/null
    echo $? >"$out/$name.exit"
}
within() {  # within SECONDS COMMAND...: until the command succeeds
    local end=$((SECONDS + $1)); shift
    until "$@" >/dev/null 2>&1; do
        ((SECONDS < end)) || { echo "not within the time: $*"; return 1; }
        sleep 0.2
    done
}
show() { systemctl show vgyrod -p ActiveState,SubState,Result,MainPID,NRestarts,StatusText,ExecMainStatus,UnitFileState,LoadState; }
says() { [[ $(systemctl show vgyrod -p "$1" --value) == $2 ]]; }
pid() { systemctl show vgyrod -p MainPID --value; }
journal() { journalctl -u vgyrod --no-pager -o short-unix --since "@$1"; }
other_pid() {  # one call, because between two the process may change
    local shown; shown=$(systemctl show vgyrod -p ActiveState,MainPID)
    [[ $shown == *ActiveState=active* && $shown =~ MainPID=([1-9][0-9]*) && ${BASH_REMATCH[1]} != "$1" ]]
}
said() { (($(journal "$since" | grep -c -e "$1") >= ${2-1})); }  # said TEXT [TIMES]: since $since
play() { canplayer -I "$here/$1.log"; }
watch_time() {  # notes the end and the length, in microseconds, of each 20 ms sleep that took 50 ms more
    local before=${EPOCHREALTIME/./} now never
    exec {never}<><(:)
    while :; do
        read -rt 0.02 -u $never
        now=${EPOCHREALTIME/./}
        ((now - before < 70000)) || echo "$now $((now - before - 20000))"
        before=$now
    done
}
mkdir -p /run/modules
mount -t hostfs none /run/modules -o "$(cat $here/modules.path)"
for module in can can-raw can-dev vcan; do insmod "$(find /run/modules -name "$module.ko*")"; done 2>"$out/modules.txt"

# The example units, installed before the interfaces exist.
cp $here/examples/*.network $here/examples/*.link /etc/systemd/network/
udevadm control --reload
for name in vcan0 vcan1 can0; do ip link add $name type vcan && ip link set $name up; done
udevadm settle
step links ip -details link show can0
systemctl start systemd-networkd
step networkd journalctl -b -u systemd-networkd -u systemd-udevd --no-pager
systemctl stop systemd-networkd

candump -L -D -r 4000000 vcan0,610:7FC >/run/capture.log &
dump=$!
watch_time >/run/stalls.txt &
watch=$!

# Installed, not configured.
since=0
step install dpkg -i $here/vgyro.deb
step unconfigured_said within 30 said 'names no gyros yet'
step unconfigured show
step unconfigured_journal journal 0
step unconfigured_failed systemctl list-units --failed --no-legend
cp /run/capture.log $out/unconfigured.log

# Badly configured.
echo '[[gyro]]' >/etc/vgyro/vgyro.toml
step bad_start systemctl start vgyrod
sleep 3  # it must not be started again
step bad_started show

# Configured, and with recordings of the inputs, as the packaged file says.
sed -i 's/^#VGYROD_OPTIONS=/VGYROD_OPTIONS=/' /etc/default/vgyrod
cp $here/vgyro.toml /etc/vgyro/vgyro.toml
cp $here/twin.dbc /usr/local/share/twin.dbc
step start systemctl start vgyrod
step started show
main=$(pid)
step process cat /proc/$main/status
step namespaces readlink /proc/1/ns/{mnt,user,ipc} /proc/$main/ns/{mnt,user,ipc}
step mounts grep -E ' / | /etc | /tmp | /dev ' /proc/$main/mountinfo
step security systemd-analyze security vgyrod --no-pager
step play play calibration

# D-Bus: any user may read, only root may call methods.
gateway=(org.vgyro.Gateway1 /org/vgyro/Gateway1)
nobody() { setpriv --reuid=65534 --regid=65534 --clear-groups "$@"; }
while_running() {  # STATUS is sent once a second, which a busy host may miss
    local try code=1
    for try in 1 2 3 4; do
        play rest &
        within 3 says StatusText 'running*' && "$@" && code=0
        wait $!
        ((code)) || return 0
    done
    return 1
}
step introspect busctl introspect "${gateway[@]}" --no-pager
step property nobody busctl get-property "${gateway[@]}" org.vgyro.Gateway1 State
step status while_running nobody vgyro status --json
step refused nobody busctl call "${gateway[@]}" org.vgyro.Gateway1 Recalibrate
step recalibrate vgyro recalibrate
sleep 1
step recalibrate_play play calibration
step save busctl call "${gateway[@]}" org.vgyro.Gateway1 SaveState
step capture_refused nobody vgyro capture
step capture vgyro capture
step capture_read vgyro convert -o /run/recorded.log "$(<$out/capture.txt)/recording.log.xz"
step capture_lines sh -c "cut -d' ' -f2,3 /run/recorded.log | cut -d'#' -f1 | sort -u"
step capture_said cat "$(<$out/capture.txt)/capture.json"
step capture_modes stat -L -c '%a %U %n' /var/lib/vgyro/captures/*

# Killed, and started again with its saved biases.
since=$(date +%s)
kill -9 $main
step killed within 60 other_pid $main
step killed_show show
step killed_play play rest
step killed_journal journal $since
main=$(pid)

# Another configuration: a bad one, one with another identifier, and the first again.
since=$(date +%s)
sed 's/^rest_s/resst_s/' $here/vgyro.toml >/etc/vgyro/vgyro.toml
step reload_bad systemctl reload vgyrod
step reload_bad_said within 30 said 'configuration is refused'
within 30 says ActiveState active
step reload_bad_show show
tac $here/vgyro.toml | sed '0,/^bus = /s//bias_id = 0x613\n&/' | tac >/etc/vgyro/vgyro.toml
step reload_good systemctl reload vgyrod
step reload_good_said within 30 said 'the new configuration is in use'
step reload_play play rest
cp $here/vgyro.toml /etc/vgyro/vgyro.toml
step reload_back systemctl reload vgyrod
step reload_back_said within 30 said 'the new configuration is in use' 2
within 30 says ActiveState active
step reload_show show
step reload_journal journal $since

# Stopped by a signal: the watchdog ends it.
since=$(date +%s)
kill -STOP $main
step watchdog within 90 other_pid $main
step watchdog_show show
step watchdog_play play rest
step watchdog_journal journal $since
main=$(pid)

# The link goes down and up.
since=$(date +%s)
ip link set vcan0 down
step link_down within 30 said 'vcan0: link went down'
sleep 1  # frames of this second must not be sent afterwards
ip link set vcan0 up
step link_up within 30 said 'vcan0: link is up again'
step link_play play rest
step link_show show
step link_journal journal $since
echo $main >$out/link_main.txt

# Another version, with the same configuration file.
since=$(date +%s)
step upgrade dpkg -i $here/vgyro-next.deb
step upgraded show
step upgraded_config cmp /etc/vgyro/vgyro.toml $here/vgyro.toml
step upgraded_play play rest
step upgraded_journal journal $since

# Back to the first version, with what the second one has kept.
since=$(date +%s)
step downgrade dpkg -i $here/vgyro.deb
step downgraded show
step downgraded_play play rest
step downgraded_journal journal $since

# A state that a later release has written, in a format of its own: sealed as its writer would, by gzip's CRC-32.
systemctl stop vgyrod
state=/var/lib/vgyro/state.toml
cp -p $state /run/good.toml
sed -e '/^\[checksum\]$/,$d' -e 's/^format = .*/format = 99/' $state | head -c -1 >/run/later.toml
crc=$(gzip -c /run/later.toml | tail -c 8 | od -An -N4 -tx4 | tr -d ' ')
printf '\n[checksum]\ncrc32 = "%s"\n' "$crc" >>/run/later.toml
cat /run/later.toml >$state
since=$(date +%s)
step later_start systemctl start vgyrod
step later_play play rest
step later_said within 10 said 'format 99'
step later_show show
step later_kept cmp $state.refused /run/later.toml
step later_journal journal $since
systemctl stop vgyrod
cp -p /run/good.toml $state
systemctl start vgyrod

# Stopped, removed, purged.
step stop systemctl stop vgyrod
step stopped show
step state stat -L -c '%a %U %F' /var/lib/vgyro /var/lib/vgyro/state.toml
cp /var/lib/vgyro/state.toml $out/state.toml
systemctl start vgyrod
step remove dpkg -r vgyro
step removed show
step removed_left ls /etc/vgyro/vgyro.toml /var/lib/vgyro/state.toml
step removed_processes sh -c "grep -l vgyrod /proc/[0-9]*/comm"
step purge dpkg -P vgyro
step purged_left find / -xdev '(' -path /usr/local -o -path /proc -o -path /var/lib/dpkg -o -path /run ')' -prune -o -name '*vgyro*' -print
step purged_failed systemctl list-units --failed --no-legend

kill $watch $dump
wait $dump
cp /run/capture.log /run/stalls.txt $out/
step journal journalctl -b --no-pager -p warning
cat /proc/uptime >$out/uptime.txt
